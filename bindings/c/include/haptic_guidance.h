/* The shipping haptic-guidance ECU for C: frames in, frames out, a millisecond a step. No heap, no global state.
 *
 * An ECU lies in memory of the caller (hg_ecu). Every function returns an hg_status; one that refuses leaves the ECU
 * and what it would write as they were. Times are a free-running count of microseconds that may wrap. Positive torques,
 * angles and errors are to the left. The caller keeps two calls on one ECU apart.
 *
 * Link libhaptic_guidance.a of the target (cargo xtask c leaves it in target/dist/c).
 */
#ifndef HAPTIC_GUIDANCE_H
#define HAPTIC_GUIDANCE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Bytes and alignment of an ECU on every target; hg_ecu_size and hg_ecu_align say what this one takes. */
#define HG_ECU_SIZE 4608
#define HG_ECU_ALIGN 8

/* Number of parameters; hg_parameter numbers them. */
#define HG_PARAMETERS 31

/* Torque of one count of hg_step.torque_raw: 2^-12 N.m, as on the bus. */
#define HG_TORQUE_LSB_NM (1.0 / 4096.0)

typedef union hg_ecu {
    uint64_t align;
    uint8_t bytes[HG_ECU_SIZE];
} hg_ecu;

typedef enum hg_status {
    HG_OK = 0,
    HG_ERROR_NULL = 1,      /* a pointer is null */
    HG_ERROR_ALIGNMENT = 2, /* a pointer is not aligned for its type */
    HG_ERROR_NOT_MADE = 3,  /* hg_ecu_init did not make this ECU */
    HG_ERROR_RANGE = 4,     /* a value is outside its range or no number */
    /* Why a frame is not used; the last good one stays in use until it is stale. */
    HG_REJECT_LENGTH = 16,      /* not as long as its message is */
    HG_REJECT_CRC = 17,         /* flipped bits, or another message's data ID */
    HG_REJECT_REPEATED = 18,    /* the counter repeats the last one */
    HG_REJECT_JUMP = 19,        /* the counter went back or too far ahead */
    HG_REJECT_NOT_TRUSTED = 20, /* not yet three clean frames since a silence */
    HG_REJECT_RANGE = 21,       /* a signal is outside its range */
    HG_REJECT_STEP = 22,        /* further from the last value than a vehicle can move */
    HG_REJECT_OLDER = 23,       /* true before the last sample was */
    HG_REJECT_OWN_IDENTIFIER = 24, /* somebody else sends under an identifier of this ECU */
    HG_REJECT_TOO_FAST = 25,    /* the counter goes faster than time and jitter allow */
    HG_REJECT_TWO_SENDERS = 26, /* two senders under one identifier: neither is believed */
    HG_REJECT_OTHER = 31        /* a reason that this header does not know */
} hg_status;

typedef enum hg_mode {
    HG_MODE_BOOT = 0,
    HG_MODE_STANDBY = 1,
    HG_MODE_ACTIVE = 2,
    HG_MODE_FADE = 3,
    HG_MODE_HANDOVER = 4,
    HG_MODE_FAULT = 5,
    HG_MODE_LOCKED = 6
} hg_mode;

/* The parameters in the order of the values, SI units (docs/parameters.md has ranges and defaults). */
typedef enum hg_parameter {
    HG_K_1 = 0,
    HG_A_1 = 1,
    HG_A_2 = 2,
    HG_A_3 = 3,
    HG_A_4 = 4,
    HG_RATE_CORNER_HZ = 5,
    HG_TORQUE_LIMIT_NM = 6,
    HG_WIND_UP_NM_PER_S = 7,
    HG_REDUCTION_NM_PER_S = 8,
    HG_LEAST_SPEED_M_PER_S = 9,
    HG_PROBE_AMPLITUDE_NM = 10,
    HG_PROBE_FREQUENCY_HZ = 11,
    HG_T_NMS_S = 12,
    HG_K_NMS = 13,
    HG_LOW_SPEED_SHARE = 14,
    HG_HIGH_SPEED_SHARE = 15,
    HG_VEHICLE_CURVATURE_GAIN_PER_M = 16,
    HG_VEHICLE_STABILITY_FACTOR_S2_PER_M2 = 17,
    HG_VEHICLE_ALIGNING_GAIN_NM_S2_PER_M = 18,
    HG_VEHICLE_COLUMN_DAMPING_NM_S = 19,
    HG_VEHICLE_FAR_TIME_S = 20,
    HG_VEHICLE_NEAR_TIME_S = 21,
    HG_LAW = 22,
    HG_ACTIVITY_LAMBDA_MIN = 23,
    HG_TORQUE_SENSOR = 24,
    HG_WHEEL_INERTIA_KG_M2 = 25,
    HG_WHEEL_DAMPING_NM_S = 26,
    HG_WHEEL_FRICTION_NM = 27,
    HG_BAR_STIFFNESS_NM_PER_RAD = 28,
    HG_COLUMN_PERIOD_S = 29,
    HG_OBSERVER_BANDWIDTH_RAD_PER_S = 30
} hg_parameter;

/* A classic CAN data frame. */
typedef struct hg_frame {
    uint16_t id; /* 11 bits */
    uint8_t len; /* 0 to 8 */
    uint8_t data[8];
} hg_frame;

/* What one step decided and puts on the bus. */
typedef struct hg_step {
    int16_t torque_raw; /* guidance torque to apply until the next step, HG_TORQUE_LSB_NM */
    uint8_t mode;       /* hg_mode */
    uint8_t limit;      /* the limit that acted, as LimitReason in core/haptic.dbc */
    uint8_t warning;    /* 1: the driver has to take over */
    uint8_t permitted;  /* 0: the monitor withdrew its permission; do not feed the watchdog */
    uint8_t frame_count;
    uint8_t reserved;
    uint32_t faults;    /* the fault word, a bit for each fault of core/haptic.dbc */
    hg_frame frames[4]; /* frame_count of them, the guidance frame first */
} hg_step;

/* What an ECU takes on this target, at most HG_ECU_SIZE and HG_ECU_ALIGN. */
size_t hg_ecu_size(void);
size_t hg_ecu_align(void);

/* The name of a parameter as docs/parameters.md has it, a string of the library's; null if there is no such number. */
const char *hg_parameter_name(uint32_t number);

/* Fills HG_PARAMETERS values with the defaults. */
int32_t hg_parameters_default(double *values);

/* Makes an ECU. values: HG_PARAMETERS of them, or null for the defaults. engaged: 0 boots as on a vehicle (Active on a
 * rise of the request, after half a second of valid data), 1 guides from the start with every sender trusted, for
 * studies. wrong: null, or where HG_ERROR_RANGE leaves the number of the parameter out of range, HG_PARAMETERS for a
 * product of several. */
int32_t hg_ecu_init(hg_ecu *ecu, const double *values, uint8_t engaged, uint32_t now_us, uint32_t *wrong);

/* 1 for an identifier under which the ECU hears something, else 0. */
uint8_t hg_is_input(uint16_t id);

/* Takes a frame that arrived at now_us. Frames of no interest are HG_OK. */
int32_t hg_ecu_receive(hg_ecu *ecu, const hg_frame *frame, uint32_t now_us);

/* One step of the 1 kHz loop. */
int32_t hg_ecu_step(hg_ecu *ecu, uint32_t now_us, hg_step *out);

/* Frames of the senders, with CRC and counter (its lowest four bits count). Values beyond a signal's range saturate;
 * one that is no finite number, or an authority outside 0 to 1, is HG_ERROR_RANGE. */
int32_t hg_lane_preview(double e_y_m, double e_theta_rad, uint32_t age_us, uint8_t valid, uint8_t counter,
                        hg_frame *out);
int32_t hg_column(double driver_torque_nm, double wheel_angle_rad, double motor_torque_nm, uint8_t counter,
                  hg_frame *out);
int32_t hg_vehicle(double speed_m_per_s, double second_speed_m_per_s, uint8_t counter, hg_frame *out);
/* The same message of a vehicle that measures its yaw rate, positive to the left. */
int32_t hg_vehicle_with_yaw_rate(double speed_m_per_s, double second_speed_m_per_s, double yaw_rate_rad_per_s,
                                 uint8_t counter, hg_frame *out);
int32_t hg_request(uint8_t engage, double authority, uint8_t probe, uint8_t counter, hg_frame *out);

#ifdef __cplusplus
}
#endif

#endif
