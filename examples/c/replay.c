/* Replays a bus: reads "t_us id data" (decimal, hexadecimal, hexadecimal) from standard input, in order, hands what is
 * addressed to the ECU to it, steps it once for each time, and prints what it sends in the same form. */
#include <stdio.h>
#include <string.h>

#include "haptic_guidance.h"

static hg_ecu ecu;

static void step_and_print(uint32_t now_us) {
    hg_step step;
    uint8_t i, b;
    if (hg_ecu_step(&ecu, now_us, &step) != HG_OK) {
        return;
    }
    for (i = 0; i < step.frame_count; ++i) {
        printf("%lu %03X ", (unsigned long)now_us, step.frames[i].id);
        for (b = 0; b < step.frames[i].len; ++b) {
            printf("%02X", step.frames[i].data[b]);
        }
        printf("\n");
    }
}

int main(void) {
    unsigned long t_us, now_us = 0;
    unsigned id;
    char text[17];
    int any = 0;
    if (hg_ecu_init(&ecu, NULL, 1, 0, NULL) != HG_OK) {
        return 1;
    }
    while (scanf("%lu %x %16s", &t_us, &id, text) == 3) {
        hg_frame frame = {0};
        unsigned byte;
        if (any && t_us != now_us) {
            step_and_print((uint32_t)now_us);
        }
        now_us = t_us;
        any = 1;
        frame.id = (uint16_t)id;
        frame.len = (uint8_t)(strlen(text) / 2);
        for (byte = 0; byte < frame.len; ++byte) {
            unsigned value = 0;
            (void)sscanf(text + 2 * byte, "%2x", &value);
            frame.data[byte] = (uint8_t)value;
        }
        if (hg_is_input(frame.id)) {
            if (hg_ecu_receive(&ecu, &frame, (uint32_t)now_us) != HG_OK) {
                return 1;
            }
        }
    }
    if (any) {
        step_and_print((uint32_t)now_us);
    }
    return 0;
}
