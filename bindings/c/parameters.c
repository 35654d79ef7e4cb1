/* Every parameter of the header is the one that the library knows by that name: each is set, by its name in the header,
 * to what is no number, and the ECU has to refuse the parameter of that name. `cargo xtask c` makes every_parameter.h of
 * the header: CHECK(NAME) for each. */
#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "haptic_guidance.h"

static hg_ecu ecu;
static int checked, failed;

/* HG_VEHICLE_FAR_TIME_S is vehicle.far_time_s. */
static int same(const char *in_header, const char *in_library) {
    if (in_library == NULL || strncmp(in_header, "HG_", 3) != 0) {
        return 0;
    }
    for (in_header += 3; *in_header && *in_library; ++in_header, ++in_library) {
        if (tolower((unsigned char)*in_header) != (*in_library == '.' ? '_' : *in_library)) {
            return 0;
        }
    }
    return *in_header == *in_library;
}

static void check(unsigned number, const char *name) {
    double values[HG_PARAMETERS];
    uint32_t wrong = HG_PARAMETERS;
    int32_t status;
    const char *refused;
    (void)hg_parameters_default(values);
    values[number] = strtod("nan", NULL);
    status = hg_ecu_init(&ecu, values, 0, 0, &wrong);
    refused = hg_parameter_name(wrong);
    if (status != HG_ERROR_RANGE || wrong != number || !same(name, refused)) {
        printf("%s = %u is %s to the library\n", name, number, refused ? refused : "nothing");
        ++failed;
    }
    ++checked;
}

int main(void) {
#define CHECK(name) check(name, #name);
#include "every_parameter.h"
    if (checked != HG_PARAMETERS || !hg_parameter_name(HG_PARAMETERS - 1) || hg_parameter_name(HG_PARAMETERS)) {
        printf("the header names %d parameters and counts %d\n", checked, HG_PARAMETERS);
        ++failed;
    }
    if (failed == 0) {
        printf("%d parameters are set by their names in the header\n", checked);
    }
    return failed != 0;
}
