// Which kind of processor this is.

#include "dispatch.hpp"

#include "pretouch.h"

#ifdef PRETOUCH_X86
#include <cpuid.h>
#endif

namespace {

#ifdef PRETOUCH_X86
constexpr uint32_t bit(int place) { return 1u << place; }
constexpr uint32_t AVX2 = bit(5) | bit(3) | bit(8);  // leaf 7, ebx: AVX2, BMI, BMI2
constexpr uint32_t AVX512 = bit(16) | bit(17) | bit(28) | bit(30) | bit(31);  // F, DQ, CD, BW, VL
constexpr uint32_t FMA = bit(12), SAVES = bit(27);  // leaf 1, ecx: FMA, OSXSAVE

int best() {
    uint32_t a, b, c, d, low, high;
    if (!__get_cpuid(1, &a, &b, &c, &d) || (c & (FMA | SAVES)) != (FMA | SAVES)) return 0;
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));  // which registers the system keeps
    if ((low & 0x6) != 0x6 || !__get_cpuid_count(7, 0, &a, &b, &c, &d) || (b & AVX2) != AVX2) return 0;
    return (low & 0xe6) == 0xe6 && (b & AVX512) == AVX512 ? 2 : 1;
}
#else
int best() { return 0; }
#endif

}  // namespace

int pretouch_chosen = best();

int pretouch_best_variant(void) { return best(); }

int pretouch_choose_variant(int wanted) {
    const int most = best();
    return pretouch_chosen = wanted < 0 || wanted > most ? most : wanted;
}
