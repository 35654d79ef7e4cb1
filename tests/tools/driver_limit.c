/* The rule that haptic-sim's law `driver_limit` has, as opendbc's C has it: compiled with an include path to a checkout of
 * commaai/opendbc by `host-sim/sim/tests/driver_limit.rs`, which says how to run it. Reads cases of nine int from the standard
 * input (torque, last torque, MAX, rates up and down, allowance, factor, least and largest torque of the driver), writes for
 * each a byte: 1 where the torque is allowed. */

#include <stdint.h>
#include <stdio.h>

uint32_t microsecond_timer_get(void);
uint32_t microsecond_timer_get(void) { return 0; }

#include "opendbc/safety/can.h"
#include "opendbc/safety/safety.h"

#define BLOCK 10000

int main(void) {
  static int cases[BLOCK][9];
  static unsigned char answers[BLOCK];
  size_t count;
  while ((count = fread(cases, sizeof cases[0], BLOCK, stdin)) > 0) {
    for (size_t i = 0; i < count; i++) {
      const int *c = cases[i];
      struct sample_t driver = {.min = c[7], .max = c[8]};
      answers[i] = !(safety_max_limit_check(c[0], c[2], -c[2]) ||
                     driver_limit_check(c[0], c[1], &driver, c[2], c[3], c[4], c[5], c[6]));
    }
    fwrite(answers, 1, count, stdout);
    fflush(stdout);
  }
  return 0;
}
