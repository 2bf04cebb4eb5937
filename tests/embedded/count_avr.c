/* Runs an exported law on an ATmega328P over the rows of avr_rows.h, and prints over its serial port how many cycles the
 * steps take and how much the outputs differ from those of the rows. simavr shows the lines, and ends with the sleep. */
#include "pretouch_design.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/pgmspace.h>
#include <avr/sleep.h>
#include <math.h>
#include <stdio.h>

/* reading, age, contact force, fresh; then the expected position, velocity and status */
typedef struct {
    float in[4], want[2];
    int16_t status;
} row;
static const row rows[] PROGMEM = {
#include "avr_rows.h"
};

static int put(char c, FILE *file) {
    (void)file;
    while (!(UCSR0A & (1 << UDRE0))) {}
    UDR0 = (uint8_t)c;
    return 0;
}

int main(void) {
    static FILE out_file = FDEV_SETUP_STREAM(put, NULL, _FDEV_SETUP_WRITE);
    static pretouch_design_state state;
    uint16_t most = 0, flags = 0;
    uint32_t all = 0;
    float difference[2] = {0, 0};
    const uint16_t count = sizeof rows / sizeof rows[0];
    UCSR0B = 1 << TXEN0;
    stdout = &out_file;
    TCCR1B = 1 << CS10; /* one count per cycle */
    pretouch_design_start(&state);
    for (uint16_t i = 0; i < count; i++) {
        row now;
        memcpy_P(&now, &rows[i], sizeof now);
        const pretouch_sample sample = {now.in[0], now.in[1], now.in[2], 0, 0, 0, (int32_t)now.in[3]};
        pretouch_output out;
        const uint16_t before = TCNT1;
        pretouch_design_step(&state, &sample, &out);
        const uint16_t spent = TCNT1 - before;
        most = spent > most ? spent : most;
        all += spent;
        flags += out.status != now.status;
        difference[0] = fmax(difference[0], fabs(out.position - now.want[0]));
        difference[1] = fmax(difference[1], fabs(out.velocity - now.want[1]));
    }
    printf("\n steps %u mean %lu most %u flags %u position_nm %lu velocity_nm_s %lu state %u\n", count,
           (unsigned long)(all / count), most, flags, (unsigned long)(1e9f * difference[0]),
           (unsigned long)(1e9f * difference[1]), (unsigned)sizeof state);
    cli();
    sleep_enable();
    sleep_cpu();
    return 0;
}
