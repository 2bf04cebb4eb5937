/* Runs a co-simulation unit with FMI Library, which shares no code with FMPy. Arguments: path of the unit, an empty folder,
 * the step [s]. Reads rows of 8 doubles: number of the case, the 6 real inputs, fresh. Writes the 6 outputs of each step.
 * Prints each message of the library from the level of warnings on. */
#include <fmilib.h>

#include <stdio.h>
#include <stdlib.h>

static const char *const INPUTS[6] = {"reading", "age", "contact_force", "reference_position", "reference_velocity",
                                      "reference_acceleration"};
static const char *const OUTPUTS[5] = {"position", "velocity", "acceleration", "virtual_force", "log_level"};

static void show(jm_callbacks *c, jm_string module, jm_log_level_enu_t level, jm_string message) {
    (void)c;
    fprintf(stderr, "%s, %s: %s\n", module, jm_log_level_to_string(level), message);
}

static void check(int failed, const char *call) {
    if (failed) exit(fprintf(stderr, "%s failed\n", call));
}

static unsigned int reference_2(fmi2_import_t *unit, const char *name) {
    return fmi2_import_get_variable_vr(fmi2_import_get_variable_by_name(unit, name));
}

static unsigned int reference_3(fmi3_import_t *unit, const char *name) {
    return fmi3_import_get_variable_vr(fmi3_import_get_variable_by_name(unit, name));
}

static void play_2(fmi_import_context_t *context, const char *folder, double step) {
    fmi2_import_t *const unit = fmi2_import_parse_xml(context, folder, NULL);
    check(unit == NULL, "parse_xml");
    fmi2_callback_functions_t callbacks = {fmi2_log_forwarding, calloc, free, NULL, unit};
    check(fmi2_import_create_dllfmu(unit, fmi2_fmu_kind_cs, &callbacks), "create_dllfmu");
    check(fmi2_import_instantiate(unit, "unit", fmi2_cosimulation, "", fmi2_false), "instantiate");
    unsigned int in[6], out[5], status = reference_2(unit, "status");
    unsigned int arrival[2] = {reference_2(unit, "fresh"), reference_2(unit, "no_object")};
    for (int i = 0; i < 6; i++) in[i] = reference_2(unit, INPUTS[i]);
    for (int i = 0; i < 5; i++) out[i] = reference_2(unit, OUTPUTS[i]);
    double row[8], result[6], last = -1, time = 0;
    while (fread(row, sizeof row, 1, stdin) == 1) {
        if (row[0] != last) {
            if (last >= 0) check(fmi2_import_terminate(unit) || fmi2_import_reset(unit), "reset");
            check(fmi2_import_setup_experiment(unit, fmi2_false, 0, 0, fmi2_false, 0), "setup_experiment");
            check(fmi2_import_enter_initialization_mode(unit), "enter_initialization_mode");
            check(fmi2_import_exit_initialization_mode(unit), "exit_initialization_mode");
            time = 0;
        }
        last = row[0];
        const fmi2_boolean_t arrived[2] = {row[7] != 0, row[7] == 2};
        fmi2_integer_t flags;
        check(fmi2_import_set_real(unit, in, 6, row + 1) || fmi2_import_set_boolean(unit, arrival, 2, arrived), "set");
        check(fmi2_import_do_step(unit, time, step, fmi2_true), "do_step");
        check(fmi2_import_get_real(unit, out, 5, result) || fmi2_import_get_integer(unit, &status, 1, &flags), "get");
        result[5] = flags;
        time += step;
        fwrite(result, sizeof result, 1, stdout);
    }
    fmi2_import_free_instance(unit);
    fmi2_import_destroy_dllfmu(unit);
    fmi2_import_free(unit);
}

static void play_3(fmi_import_context_t *context, const char *folder, double step) {
    fmi3_import_t *const unit = fmi3_import_parse_xml(context, folder, NULL);
    check(unit == NULL, "parse_xml");
    check(fmi3_import_create_dllfmu(unit, fmi3_fmu_kind_cs, NULL, NULL), "create_dllfmu");
    check(fmi3_import_instantiate_co_simulation(unit, "unit", "", 0, 0, 0, 0, NULL, 0, NULL), "instantiate");
    unsigned int in[6], out[5], status = reference_3(unit, "status");
    unsigned int arrival[2] = {reference_3(unit, "fresh"), reference_3(unit, "no_object")};
    for (int i = 0; i < 6; i++) in[i] = reference_3(unit, INPUTS[i]);
    for (int i = 0; i < 5; i++) out[i] = reference_3(unit, OUTPUTS[i]);
    double row[8], result[6], last = -1, time = 0, reached;
    fmi3_boolean_t event, terminate, early;
    while (fread(row, sizeof row, 1, stdin) == 1) {
        if (row[0] != last) {
            if (last >= 0) check(fmi3_import_terminate(unit) || fmi3_import_reset(unit), "reset");
            check(fmi3_import_enter_initialization_mode(unit, 0, 0, 0, 0, 0), "enter_initialization_mode");
            check(fmi3_import_exit_initialization_mode(unit), "exit_initialization_mode");
            time = 0;
        }
        last = row[0];
        const fmi3_boolean_t arrived[2] = {row[7] != 0, row[7] == 2};
        fmi3_int32_t flags;
        check(fmi3_import_set_float64(unit, in, 6, row + 1, 6), "set_float64");
        check(fmi3_import_set_boolean(unit, arrival, 2, arrived, 2), "set_boolean");
        check(fmi3_import_do_step(unit, time, step, 1, &event, &terminate, &early, &reached), "do_step");
        check(event || terminate || early || reached != time + step, "do_step as a whole");
        check(fmi3_import_get_float64(unit, out, 5, result, 5), "get_float64");
        check(fmi3_import_get_int32(unit, &status, 1, &flags, 1), "get_int32");
        result[5] = flags;
        time += step;
        fwrite(result, sizeof result, 1, stdout);
    }
    fmi3_import_free_instance(unit);
    fmi3_import_destroy_dllfmu(unit);
    fmi3_import_free(unit);
}

int main(int argc, char **argv) {
    check(argc != 4, "reading the arguments");
    jm_callbacks callbacks = {malloc, calloc, realloc, free, show, jm_log_level_warning, NULL, ""};
    fmi_import_context_t *const context = fmi_import_allocate_context(&callbacks);
    const fmi_version_enu_t version = fmi_import_get_fmi_version(context, argv[1], argv[2]);
    check(version != fmi_version_2_0_enu && version != fmi_version_3_0_enu, "reading the version");
    (version == fmi_version_2_0_enu ? play_2 : play_3)(context, argv[2], atof(argv[3]));
    fmi_import_free_context(context);
    return 0;
}
