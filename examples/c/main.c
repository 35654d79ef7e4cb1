/* The shipping ECU from C: boots, is asked for guidance, follows a swaying target, loses its camera, hands over.
 *
 * Prints the modes as they come and a checksum of every frame sent, the same on every target.
 */
#include <stdio.h>

#include "haptic_guidance.h"

enum { STEPS = 4000, ENGAGE_AT = 600, BLIND_FROM = 3000 };

static hg_ecu ecu;

static int refused(int32_t status) {
    if (status != HG_OK) {
        printf("refused: %ld\n", (long)status);
    }
    return status != HG_OK;
}

/* FNV-1a over identifier, length and data. */
static uint32_t checksum(uint32_t sum, const hg_frame *frame) {
    uint8_t i;
    sum = (sum ^ frame->id) * 16777619u;
    sum = (sum ^ frame->len) * 16777619u;
    for (i = 0; i < frame->len; ++i) {
        sum = (sum ^ frame->data[i]) * 16777619u;
    }
    return sum;
}

int main(void) {
    uint32_t k, sum = 2166136261u, frames = 0;
    uint8_t mode = 255, i;
    hg_step step = {0};
    if (refused(hg_ecu_init(&ecu, NULL, 0, 0, NULL))) {
        return 1;
    }
    for (k = 0; k < STEPS; ++k) {
        const uint32_t now_us = 1000 * k;
        /* A triangle between -0.1 and 0.1 m, 4 s long. */
        const int32_t phase = (int32_t)(k % 4000);
        const double e_y_m = (phase < 2000 ? phase - 1000 : 3000 - phase) * 0.0001;
        hg_frame frame;
        if (k % 8 == 0 && k < BLIND_FROM) {
            if (refused(hg_lane_preview(e_y_m, 0.0, 0, 1, (uint8_t)(k / 8), &frame))) {
                return 1;
            }
            (void)hg_ecu_receive(&ecu, &frame, now_us);
        }
        if (k % 2 == 0) {
            if (refused(hg_column(0.0, 0.0, step.torque_raw * HG_TORQUE_LSB_NM, (uint8_t)(k / 2), &frame))) {
                return 1;
            }
            (void)hg_ecu_receive(&ecu, &frame, now_us);
        }
        if (k % 10 == 0) {
            if (refused(hg_vehicle(16.5, 16.5, (uint8_t)(k / 10), &frame))) {
                return 1;
            }
            (void)hg_ecu_receive(&ecu, &frame, now_us);
            if (refused(hg_request(k >= ENGAGE_AT, 1.0, 0, (uint8_t)(k / 10), &frame))) {
                return 1;
            }
            (void)hg_ecu_receive(&ecu, &frame, now_us);
        }
        if (refused(hg_ecu_step(&ecu, now_us, &step))) {
            return 1;
        }
        for (i = 0; i < step.frame_count; ++i) {
            sum = checksum(sum, &step.frames[i]);
            ++frames;
        }
        if (step.mode != mode) {
            mode = step.mode;
            printf("%4lu ms: mode %u, torque %d/4096 N.m, faults 0x%lx\n", (unsigned long)k, mode, step.torque_raw,
                   (unsigned long)step.faults);
        }
    }
    printf("%lu frames, checksum %08lx\n", (unsigned long)frames, (unsigned long)sum);
    return 0;
}
