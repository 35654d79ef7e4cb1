/*
 * One closed loop of driver, guidance, bus, steering column, vehicle and road, in float64.
 *
 * Responsible for: being an independent peer of the simulator. It was written from the equations of the paper
 * (IET Intelligent Transport Systems 2022, DOI 10.1049/itr2.12163; numbers in brackets are the paper's) and shares
 * no code with the Rust crates. It serves twice: its traces are the oracle of tests/data/, and its speed is what
 * the simulator is measured against.
 *
 * Terms: a tick is 1 ms. A foot is the point of the centreline nearest to a point in the plane. Near and far
 * points lie v*t_n and v*t_f ahead along the direction of movement chi = psi + beta. Positive is left everywhere.
 * `--sensors exact` hands the law exact errors each tick, and looks at the body each tick; `--sensors paper` takes the
 * errors at 120 Hz and sends them through protected frames, the torque comes back in one, and 200 times a second a sample
 * is kept: looks and record are those of the simulator.
 *
 * Above 500 lines because it is one file on purpose: a peer that a stranger compiles with one command and reads from
 * equation to trace, with nothing shared.
 *
 * Not here: modes, envelope, monitor, noise, courses other than the paper-course.
 *
 * With SHIPPING_ECU defined the ECU is the shipping one, linked as a library (bindings/c): only the world is then this
 * file's, and `cargo xtask bench speed` compares it with the simulator around the same ECU.
 *
 *   gcc -O3 -std=c11 -Wall -Wextra -o target/closed_loop bench/closed_loop.c -lm
 *   target/closed_loop --help
 */
#define _GNU_SOURCE /* sincos, clock_gettime, getopt_long */
#include <getopt.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#ifdef SHIPPING_ECU
#include "haptic_guidance.h"
#endif

static const double TICK = 1e-3;           /* s: control period and plant step */
static const double SPEED = 60.0 / 3.6;    /* m/s */
static const double TORQUE_LIMIT = 5.0;    /* N.m, section 3.2 */
static const double LANE_RATE = 120.0;     /* Hz, lane samples */
enum { SAMPLE_EVERY = 5 };                 /* ticks between samples, which look at the body and through the camera: 200 Hz */
static const double RATE_CORNER = 10.0;    /* Hz, low-pass on the differenced 120 Hz samples; our choice */
static const double MANUAL_K_D = 4.0;      /* section 5.1 */
static const double DIVERGED_BEYOND = 50.0; /* m off the centreline */

/* Tables 8 and 9. */
static const double A1 = 0.1, A2 = 0.05, A3 = 3.7, T_N = 0.3, T_F = 1.0, T_NMS = 0.1, K_NMS = 1.0;
static const double GA1 = 2.0, GA2 = 0.05, GA3 = 40.0, GA4 = 1.0, GK1 = 0.25, GT_N = 0.3, GT_F = 0.7;
static const double MASS = 1100.0, INERTIA = 2940.0, L_F = 1.0, L_R = 1.635, K_F = 53300.0, K_R = 117000.0;
static const double K_S = 48510.0, E_T = 0.026, B_S = 0.57, J_S = 0.11, K_T = 1.0 / 17.0;

/* ---- road ------------------------------------------------------------------------------------------------- */

/* Cells of at most 2 m: in the frame of a cell's middle the centreline is a short power series of the arc length,
 * the same for straight, arc and clothoid. At R 300 m its error is below 1e-10 m. */
static const double CELL = 2.0;

typedef struct {
    double end, mid;            /* arc length, m */
    double x, y, c, s, heading; /* position and direction of the middle */
    double k, dk;               /* curvature at the middle, 1/m, and its slope, 1/m^2 */
} Cell;

typedef struct {
    Cell *cell;
    size_t count;
    double length;
} Road;

typedef struct {
    double length, curvature_start, curvature_end;
} Segment;

#define BEND(entry, arc, k) {entry, 0, k}, {arc, k, k}, {entry, k, 0}
static const Segment PAPER_COURSE[] = {
    {1080, 0, 0}, BEND(80, 300, 1.0 / 300), {200, 0, 0}, BEND(80, 250, -1.0 / 400),
    {200, 0, 0},  BEND(100, 400, 1.0 / 600), {400, 0, 0},
};

/* Displacement over arc length `len` from heading `h` and curvature `k`: five-point Gauss-Legendre. */
static void arc_displacement(double h, double k, double dk, double len, double *x, double *y)
{
    static const double node[5] = {0, -0.5384693101056831, 0.5384693101056831, -0.9061798459386640, 0.9061798459386640};
    static const double weight[5] = {0.5688888888888889, 0.4786286704993665, 0.4786286704993665, 0.2369268850561891,
                                     0.2369268850561891};
    for (int i = 0; i < 5; i++) {
        double s = 0.5 * len * (1 + node[i]), a = h + s * (k + 0.5 * dk * s);
        *x += 0.5 * len * weight[i] * cos(a);
        *y += 0.5 * len * weight[i] * sin(a);
    }
}

static Road build_road(void)
{
    Road road = {0};
    double x = 0, y = 0, heading = 0;
    for (size_t i = 0; i < sizeof PAPER_COURSE / sizeof *PAPER_COURSE; i++) {
        const Segment *seg = &PAPER_COURSE[i];
        size_t n = (size_t)ceil(seg->length / CELL);
        double len = seg->length / (double)n, dk = (seg->curvature_end - seg->curvature_start) / seg->length;
        road.cell = realloc(road.cell, (road.count + n) * sizeof *road.cell);
        if (!road.cell) {
            fputs("out of memory\n", stderr);
            exit(1);
        }
        for (size_t j = 0; j < n; j++) {
            double k0 = seg->curvature_start + dk * len * (double)j, half = 0.5 * len;
            Cell *c = &road.cell[road.count++];
            *c = (Cell){.mid = road.length + half, .end = road.length + len, .x = x, .y = y, .k = k0 + dk * half, .dk = dk};
            arc_displacement(heading, k0, dk, half, &c->x, &c->y);
            c->heading = heading + half * (k0 + 0.5 * dk * half);
            sincos(c->heading, &c->s, &c->c);
            arc_displacement(heading, k0, dk, len, &x, &y);
            heading += len * (k0 + 0.5 * dk * len);
            road.length += len;
        }
    }
    return road;
}

typedef struct {
    const Cell *cell;
    double s, advance;      /* arc length of the foot, and its change in a tick before the last look */
    double offset, heading; /* point relative to its foot, left positive; heading of the centreline there */
} Foot;

static Foot foot_at(const Road *road, double s)
{
    return (Foot){.cell = road->cell, .s = s, .advance = 0};
}

/* Newton's method from where the advance leads in the ticks since the last look: after one tick it starts about 1e-7 m
 * off, so one step is exact. */
static inline void project(const Road *road, Foot *f, double px, double py, long ticks)
{
    const Cell *last = road->cell + road->count - 1;
    double from = f->s, s = from + f->advance * (double)ticks, step;
    const Cell *c = f->cell;
    do {
        while (s > c->end && c < last)
            c++;
        while (c > road->cell && s <= c[-1].end)
            c--;
        double d = s - c->mid, k = c->k, dk = c->dk;
        double dx = px - c->x, dy = py - c->y;
        double d2 = d * d, h = d * (k + 0.5 * dk * d), ch = 1 - 0.5 * h * h, sh = h * (1 - h * h * (1.0 / 6));
        double u = c->c * dx + c->s * dy - d * (1 - d2 * k * (k * (1.0 / 6) + dk * d * 0.125));
        double w = c->c * dy - c->s * dx - d2 * (0.5 * k + d * (dk * (1.0 / 6) - d * k * k * k * (1.0 / 24)));
        double n = w * ch - u * sh, kappa = k + dk * d;
        step = (u * ch + w * sh) / (1 - kappa * n);
        s += step;
        f->offset = n;
        f->heading = c->heading + h + kappa * step;
    } while (fabs(step) > 1e-6);
    f->cell = c;
    f->s = s;
    f->advance = ticks ? (s - from) / (double)ticks : 0;
}

static inline double wrapped(double angle)
{
    while (angle > M_PI)
        angle -= 2 * M_PI;
    while (angle <= -M_PI)
        angle += 2 * M_PI;
    return angle;
}

/* ---- vehicle (1)(2), aligning torque (3)(4), column (5)(6), arms (8): linear, so discretised exactly ----------- */

enum { BETA, YAW_RATE, PHI, PHI_RATE, T_D, PSI, STATES };
/* Inputs: what the arms are asked for, at the tick's start and end (linear between), and T_h (held). */
enum { ASKED_START, ASKED_END, T_H, INPUTS };

typedef struct {
    double a[STATES][STATES], b[INPUTS][STATES]; /* columns, so that the product runs down contiguous rows */
} Plant;

static Plant discretise(void)
{
    enum { N = STATES + 3 }; /* augmented by asked, its slope per tick, and T_h */
    double m[N][N] = {{0}}, power[N][N] = {{0}}, expm[N][N] = {{0}};
    const double v = SPEED, k_aln = 2 * E_T * K_F * K_T / (1 + 2 * E_T * K_F / K_S);
    m[BETA][BETA] = -2 * (K_F + K_R) / (MASS * v);
    m[BETA][YAW_RATE] = -1 - 2 * (L_F * K_F - L_R * K_R) / (MASS * v * v);
    m[BETA][PHI] = 2 * K_F * K_T / (MASS * v);
    m[YAW_RATE][BETA] = -2 * (L_F * K_F - L_R * K_R) / INERTIA;
    m[YAW_RATE][YAW_RATE] = -2 * (L_F * L_F * K_F + L_R * L_R * K_R) / (INERTIA * v);
    m[YAW_RATE][PHI] = 2 * L_F * K_F * K_T / INERTIA;
    m[PHI][PHI_RATE] = 1;
    m[PHI_RATE][BETA] = k_aln / J_S;
    m[PHI_RATE][YAW_RATE] = k_aln * L_F / v / J_S;
    m[PHI_RATE][PHI] = -k_aln * K_T / J_S;
    m[PHI_RATE][PHI_RATE] = -B_S / J_S;
    m[PHI_RATE][T_D] = 1 / J_S;
    m[T_D][T_D] = -1 / T_NMS;
    m[T_D][PHI] = -K_NMS / T_NMS;
    m[PSI][YAW_RATE] = 1;
    m[T_D][STATES] = 1 / T_NMS;         /* asked */
    m[STATES][STATES + 1] = 1 / TICK;   /* asked grows by its slope in one tick */
    m[PHI_RATE][STATES + 2] = 1 / J_S;  /* T_h */
    for (int i = 0; i < N; i++)
        power[i][i] = expm[i][i] = 1;
    for (int term = 1; term <= 20; term++) { /* norm of m*TICK is near 1: twenty terms leave 1e-18 */
        double next[N][N] = {{0}};
        for (int i = 0; i < N; i++)
            for (int j = 0; j < N; j++) {
                for (int l = 0; l < N; l++)
                    next[i][j] += power[i][l] * m[l][j] * TICK / term;
                expm[i][j] += next[i][j];
            }
        memcpy(power, next, sizeof power);
    }
    Plant p;
    for (int i = 0; i < STATES; i++) {
        for (int j = 0; j < STATES; j++)
            p.a[j][i] = expm[i][j];
        p.b[ASKED_START][i] = expm[i][STATES] - expm[i][STATES + 1];
        p.b[ASKED_END][i] = expm[i][STATES + 1];
        p.b[T_H][i] = expm[i][STATES + 2];
    }
    return p;
}

static inline void plant_step(const Plant *p, double x[STATES], const double u[INPUTS])
{
    double next[STATES] = {0};
    for (int j = 0; j < STATES; j++)
        for (int i = 0; i < STATES; i++)
            next[i] += p->a[j][i] * x[j];
    for (int j = 0; j < INPUTS; j++)
        for (int i = 0; i < STATES; i++)
            next[i] += p->b[j][i] * u[j];
    memcpy(x, next, sizeof next);
}

/* ---- bus: eight bytes, byte 0 CRC, low nibble of byte 1 counter (AUTOSAR E2E profile 2) ------------------------ */

typedef struct {
    uint8_t b[8];
} Frame;

typedef struct {
    uint8_t id[16]; /* the data ID of each counter */
    uint8_t sent, seen;
} Link;

static uint8_t crc_slice[8][256]; /* [n][x]: remainder of x followed by n zero bytes, poly 0x2F */

static void build_crc(void)
{
    for (int x = 0; x < 256; x++) {
        uint8_t r = (uint8_t)x;
        for (int bit = 0; bit < 8; bit++)
            r = (uint8_t)(r & 0x80 ? r << 1 ^ 0x2F : r << 1);
        crc_slice[0][x] = r;
    }
    for (int n = 1; n < 8; n++)
        for (int x = 0; x < 256; x++)
            crc_slice[n][x] = crc_slice[0][crc_slice[n - 1][x]];
}

/* Slicing by eight: the look-ups do not wait for each other. */
static inline uint8_t crc8(const uint8_t b[8], uint8_t id)
{
    uint8_t r = crc_slice[7][b[1] ^ 0xFF] ^ crc_slice[0][id];
    for (int i = 2; i < 8; i++)
        r ^= crc_slice[8 - i][b[i]];
    return r ^ 0xFF;
}

static Link open_link(uint8_t message)
{
    static const uint8_t base[16] = {0xD9, 0xAD, 0xC1, 0x0B, 0x75, 0xF8, 0xE0, 0x7C,
                                     0x7A, 0xE6, 0xAE, 0x92, 0x9B, 0x3E, 0xEA, 0x5E};
    Link l = {.sent = 15, .seen = 15};
    for (int i = 0; i < 16; i++)
        l.id[i] = base[i] ^ message;
    return l;
}

static inline Frame pack(Link *l, uint8_t flags, int32_t a, int32_t b, uint16_t c)
{
    l->sent = (l->sent + 1) & 15;
    Frame f = {{0, (uint8_t)(flags << 4 | l->sent), (uint8_t)a, (uint8_t)(a >> 8), (uint8_t)b, (uint8_t)(b >> 8),
                (uint8_t)c, (uint8_t)(c >> 8)}};
    f.b[0] = crc8(f.b, l->id[l->sent]);
    return f;
}

/* Hides a frame from the compiler, which leaves out CRC and check where it sees both ends. As one word: a frame that is
 * stored byte by byte and read at once would wait for its bytes. */
static inline Frame on_the_wire(Frame f)
{
    uint64_t word;
    memcpy(&word, &f, sizeof word);
    __asm__ volatile("" : "+r"(word));
    memcpy(&f, &word, sizeof word);
    return f;
}

static inline bool unpack(Link *l, const Frame *f, int16_t *a, int16_t *b, uint16_t *c)
{
    uint8_t counter = f->b[1] & 15;
    if (f->b[0] != crc8(f->b, l->id[counter]) || counter == l->seen)
        return false;
    l->seen = counter;
    *a = (int16_t)(f->b[2] | f->b[3] << 8);
    *b = (int16_t)(f->b[4] | f->b[5] << 8);
    *c = (uint16_t)(f->b[6] | f->b[7] << 8);
    return true;
}

static const double E_Y_LSB = 1.0 / 8192;      /* m */
static const double E_THETA_LSB = 1.0 / 65536; /* rad */
static const double AGE_LSB = 1e-4;            /* s */
static const double T_D_LSB = 0.005;           /* N.m, section 3.2 */
static const double PHI_LSB = 0.1 * M_PI / 180; /* rad, section 3.2 */
static const double T_H_LSB = 0.001;           /* N.m */

static inline int32_t code(double value, double lsb)
{
    double c = value / lsb;
    return (int32_t)(c > 32767 ? 32767 : c < -32768 ? -32768 : c < 0 ? c - 0.5 : c + 0.5);
}

/* ---- guidance (9) ---------------------------------------------------------------------------------------------- */

typedef struct {
    double e_y, e_theta, time, e_y_rate, e_theta_rate;
    bool primed;
} Law;

/* `corner` 0 takes the plain backward difference. */
static inline void law_sample(Law *law, double time, double e_y, double e_theta, double corner)
{
    double dt = time - law->time;
    if (law->primed && dt > 0) {
        double wdt = 2 * M_PI * corner * dt, gain = corner > 0 ? wdt / (1 + wdt) : 1.0;
        law->e_y_rate += gain * ((e_y - law->e_y) / dt - law->e_y_rate);
        law->e_theta_rate += gain * ((e_theta - law->e_theta) / dt - law->e_theta_rate);
    }
    law->e_y = e_y;
    law->e_theta = e_theta;
    law->time = time;
    law->primed = true;
}

static inline double law_torque(const Law *l)
{
    double t = GK1 * (GA1 * l->e_y + GA2 * l->e_y_rate + GA3 * l->e_theta + GA4 * l->e_theta_rate);
    return t > TORQUE_LIMIT ? TORQUE_LIMIT : t < -TORQUE_LIMIT ? -TORQUE_LIMIT : t;
}

#ifdef SHIPPING_ECU
/* ---- the shipping ECU and its senders, with the simulator's periods ------------------------------------------------ */

typedef struct {
    hg_ecu ecu;
    uint8_t lanes, columns, hosts;
    double torque;
    long frames, rejected;
} Shipping;

static void shipping_send(Shipping *e, int32_t made, const hg_frame *f, uint32_t now_us)
{
    e->frames++;
    if (made != HG_OK || hg_ecu_receive(&e->ecu, f, now_us) != HG_OK)
        e->rejected++;
}

/* A tick: what the sensors send, the ECU's step, and the torque as the actuator reads it from the frame. */
static double shipping_step(Shipping *e, Link *command, long k, bool picture, double e_y, double e_theta, double t_d,
                            double phi)
{
    const uint32_t now_us = (uint32_t)k * 1000u;
    hg_frame f;
    hg_step out;
    if (picture) {
        shipping_send(e, hg_lane_preview(e_y, e_theta, 0, 1, e->lanes++, &f), &f, now_us);
    }
    if (k % 2 == 0)
        shipping_send(e, hg_column(code(t_d, T_D_LSB) * T_D_LSB, code(phi, PHI_LSB) * PHI_LSB, e->torque, e->columns++, &f),
                      &f, now_us);
    if (k % 10 == 0) {
        shipping_send(e, hg_vehicle(SPEED, SPEED, e->hosts, &f), &f, now_us);
        shipping_send(e, hg_request(1, 1.0, 0, e->hosts++, &f), &f, now_us);
    }
    if (hg_ecu_step(&e->ecu, now_us, &out) != HG_OK || out.frame_count == 0)
        return e->torque;
    const uint8_t *b = out.frames[0].data, counter = b[1] & 15;
    e->frames++;
    if (b[0] == crc8(b, command->id[counter]) && counter != command->seen)
        e->torque = (int16_t)(uint16_t)(b[1] >> 4 | b[2] << 4 | b[3] << 12) * HG_TORQUE_LSB_NM;
    else
        e->rejected++;
    command->seen = counter;
    return e->torque;
}
#endif

/* ---- the loop ---------------------------------------------------------------------------------------------------- */

typedef struct {
    double t_p, k_d, k_hg, failure_time, takes_over, follow, hold, fall, window_from, window_to, duration;
    bool guidance, paper_sensors, hands_over;
    long repeat;
    const char *trace;
} Options;

typedef struct {
    long steps, samples, frames, rejected, window_ticks;
    double peak, sum, peak_t_h, peak_t_d;
    double column_sum; /* of the decoded column frames: their reader, so that no work can be optimised away */
    bool diverged;
} Result;

enum { DELAY_LINE = 1024 }; /* ticks; a power of two */

/* What is kept of an instant, as the simulator does. */
typedef struct {
    double time, s, offset, heading_error, curvature, e_y, e_theta, guidance_e_y, guidance_e_theta;
    double phi, phi_rate, yaw_rate, beta, speed, t_d, t_h;
} Sample;

static Result run(const Options *o, const Road *road, const Plant *plant, Sample *sample, long capacity, FILE *trace)
{
    Result r = {0};
    double x[STATES] = {0}, u[INPUTS];
    double px = 0, py = 0, c = 1, s = 0; /* centre of gravity; direction of movement */
    double line[DELAY_LINE] = {0}, e_y_integral = 0, e_y_before = 0, phi_target = 0, torque = 0;
    double k_d = o->k_d, k_hg = o->k_hg, next_lane = 0;
    long last_look = 0;
    double ge_y = 0, ge_theta = 0;
    Foot body = foot_at(road, 0), near = foot_at(road, SPEED * T_N), far = foot_at(road, SPEED * T_F);
    Foot guide_near = foot_at(road, SPEED * GT_N), guide_far = foot_at(road, SPEED * GT_F);
    Link lane = open_link(0x11), column = open_link(0x22), command = open_link(0x5A);
    Law law = {0};
    double held = 0; /* of a handover, before it falls */
#ifdef SHIPPING_ECU
    Shipping shipping = {0};
    if (hg_ecu_init(&shipping.ecu, NULL, 1, 0, NULL) != HG_OK)
        abort();
#endif

    const long delay = (long)(o->t_p / TICK + 1e-9);
    const double part = o->t_p / TICK - (double)delay > 1e-9 ? o->t_p / TICK - (double)delay : 0.0;
    const long fails = isnan(o->failure_time) ? -1 : lround(o->failure_time / TICK);
    const long responds = fails < 0 ? -1 : fails + lround(o->takes_over / TICK);
    const long end = isnan(o->duration) ? -1 : lround(o->duration / TICK);

    for (long k = 0; k != end; k++) {
        const double time = (double)k * TICK, chi = x[PSI] + x[BETA];
        project(road, &far, px + SPEED * T_F * c, py + SPEED * T_F * s, 1);
        if (far.s >= road->length)
            break;
        project(road, &near, px + SPEED * T_N * c, py + SPEED * T_N * s, 1);
        const bool is_sample = k % SAMPLE_EVERY == 0, sees_body = !o->paper_sensors || is_sample;
        if (sees_body)
            project(road, &body, px, py, o->paper_sensors ? SAMPLE_EVERY : 1);
        if (!(fabs(body.offset) < DIVERGED_BEYOND)) {
            r.diverged = true;
            break;
        }
        if (k == responds) {
            k_d = MANUAL_K_D;
            k_hg = 0;
        }

        /* driver, visual (7): phi_target(t) = w(t - t_p), linear between ticks */
        const double e_y = -near.offset;
        if (k > 0) /* trapezoid */
            e_y_integral += 0.5 * TICK * (e_y_before + e_y);
        e_y_before = e_y;
        line[k & (DELAY_LINE - 1)] = A1 * e_y + A2 * e_y_integral + A3 * wrapped(far.heading - chi);
        const long then = k + 1 - delay;
        const double before = phi_target;
        phi_target = (1 - part) * line[then & (DELAY_LINE - 1)] + part * line[(then - 1) & (DELAY_LINE - 1)];

        /* the camera: a picture in the first tick at or after its due time, and its points for each sample */
        const bool picture = !o->paper_sensors || time >= next_lane;
        if (picture)
            next_lane += 1 / LANE_RATE;
        if (picture || is_sample) {
            project(road, &guide_near, px + SPEED * GT_N * c, py + SPEED * GT_N * s, k - last_look);
            project(road, &guide_far, px + SPEED * GT_F * c, py + SPEED * GT_F * s, k - last_look);
            last_look = k;
            ge_y = -guide_near.offset;
            ge_theta = wrapped(guide_far.heading - chi);
        }

        /* guidance */
        double t_h = 0;
        if (o->guidance) {
#ifdef SHIPPING_ECU
            if (o->paper_sensors) {
                torque = shipping_step(&shipping, &command, k, picture, ge_y, ge_theta, x[T_D], x[PHI]);
            } else
#endif
            if (!o->paper_sensors) {
                law_sample(&law, time, ge_y, ge_theta, 0);
                torque = law_torque(&law);
            } else {
                int16_t a, b;
                uint16_t age;
                if (picture) {
                    Frame f = on_the_wire(pack(&lane, 1, code(ge_y, E_Y_LSB), code(ge_theta, E_THETA_LSB), 0));
                    r.frames++;
                    if (unpack(&lane, &f, &a, &b, &age))
                        law_sample(&law, time - age * AGE_LSB, a * E_Y_LSB, b * E_THETA_LSB, RATE_CORNER);
                    else
                        r.rejected++;
                }
                Frame f = on_the_wire(pack(&column, 1, code(x[T_D], T_D_LSB), code(x[PHI], PHI_LSB), 0));
                if (unpack(&column, &f, &a, &b, &age))
                    r.column_sum += a * T_D_LSB + b * PHI_LSB;
                else
                    r.rejected++;
                f = on_the_wire(pack(&command, 1, code(law_torque(&law), T_H_LSB), 0, 0));
                if (unpack(&command, &f, &a, &b, &age))
                    torque = a * T_H_LSB;
                else
                    r.rejected++;
                r.frames += 2;
            }
            if (fails < 0 || k < fails) {
                t_h = torque;
            } else if (o->hands_over) {
                const double since = (double)(k - fails) * TICK;
                if (k == fails || since < o->follow)
                    held = torque;
                t_h = held * fmin(1, fmax(0, 1 - (since - o->hold) / o->fall));
            }
        }

        if (is_sample && r.samples < capacity)
            sample[r.samples++] = (Sample){
                time, body.s, body.offset, wrapped(chi - body.heading), body.cell->k + body.cell->dk * (body.s - body.cell->mid),
                e_y, wrapped(far.heading - chi), ge_y, ge_theta, x[PHI], x[PHI_RATE], x[YAW_RATE], x[BETA], SPEED, x[T_D], t_h};
        if (sees_body && body.s >= o->window_from && body.s <= o->window_to) {
            r.window_ticks++;
            r.sum += fabs(body.offset);
            r.peak = fmax(r.peak, fabs(body.offset));
            r.peak_t_h = fmax(r.peak_t_h, fabs(t_h));
            r.peak_t_d = fmax(r.peak_t_d, fabs(x[T_D]));
        }
        if (trace && k % 500 == 0)
            fprintf(trace, "%.1f,%.4f,%.6f,%.6f,%.6f,%.6f\n", time, body.s, body.offset, t_h, x[T_D], x[PHI]);

        u[ASKED_START] = (k_d + K_NMS) * before - k_hg * t_h;
        u[ASKED_END] = (k_d + K_NMS) * phi_target - k_hg * t_h;
        u[T_H] = t_h;
        plant_step(plant, x, u);
        const double c_before = c, s_before = s;
        sincos(x[PSI] + x[BETA], &s, &c);
        px += 0.5 * TICK * SPEED * (c_before + c);
        py += 0.5 * TICK * SPEED * (s_before + s);
        r.steps++;
    }
#ifdef SHIPPING_ECU
    r.frames += shipping.frames;
    r.rejected += shipping.rejected;
#endif
    return r;
}

/* ---- command line ------------------------------------------------------------------------------------------------ */

static void usage(FILE *to)
{
    fputs("closed_loop [options]; prints one JSON object\n"
          "  --t-p S            driver's delay, 0.001 to 1 s (default 0.3)\n"
          "  --k-d K            target angle to torque, N.m/rad (default 2)\n"
          "  --k-hg K           reaction to guidance, 0 to 1 (default 0)\n"
          "  --guidance on|off  (default on)\n"
          "  --failure-time S   guidance torque is lost here (default never)\n"
          "  --fails torque|input  it drops to 0, or is handed over (default torque)\n"
          "  --follow S --hold S --fall S  a handover follows the law so long (default 1), and falls to 0 over a time\n"
          "                     (default 2) after it was held for one (default 0)\n"
          "  --takes-over S     from then until the driver has the manual gains (default 1)\n"
          "  --sensors exact|paper  (default paper: 120 Hz, frames, filtered rates)\n"
          "  --window FROM TO   metrics over this stretch, m (default 1080 1740)\n"
          "  --duration S       stop early (default: the whole course)\n"
          "  --repeat N         the fastest of N runs is timed (default 1)\n"
          "  --trace FILE       write a CSV row every 0.5 s of the first run\n", to);
}

static double number(const char *name, const char *text, double low, double high)
{
    char *rest;
    double value = strtod(text, &rest);
    if (rest == text || *rest || !(value >= low && value <= high)) {
        fprintf(stderr, "--%s: '%s' is not a number from %g to %g\n", name, text, low, high);
        exit(2);
    }
    return value;
}

static bool choice(const char *name, const char *text, const char *yes, const char *no)
{
    if (strcmp(text, yes) && strcmp(text, no)) {
        fprintf(stderr, "--%s: '%s' is neither %s nor %s\n", name, text, yes, no);
        exit(2);
    }
    return !strcmp(text, yes);
}

static Options parse(int argc, char **argv)
{
    static const struct option names[] = {
        {"t-p", 1, 0, 0},     {"k-d", 1, 0, 0},    {"k-hg", 1, 0, 0},   {"guidance", 1, 0, 0}, {"failure-time", 1, 0, 0},
        {"sensors", 1, 0, 0}, {"window", 1, 0, 0}, {"duration", 1, 0, 0}, {"repeat", 1, 0, 0},   {"trace", 1, 0, 0},
        {"help", 0, 0, 0},    {"fails", 1, 0, 0},  {"takes-over", 1, 0, 0}, {"follow", 1, 0, 0},
        {"hold", 1, 0, 0},    {"fall", 1, 0, 0},   {0, 0, 0, 0}};
    Options o = {.t_p = 0.3, .k_d = 2, .k_hg = 0, .guidance = true, .paper_sensors = true, .failure_time = NAN,
                 .takes_over = 1, .follow = 1, .fall = 2,
                 .window_from = 1080, .window_to = 1740, .duration = NAN, .repeat = 1};
    int at;
    for (int got; (got = getopt_long(argc, argv, "", names, &at)) != -1;) {
        if (got) {
            usage(stderr);
            exit(2);
        }
        const char *n = names[at].name;
        switch (at) {
        case 0: o.t_p = number(n, optarg, TICK, 1.0); break;
        case 1: o.k_d = number(n, optarg, 0, 100); break;
        case 2: o.k_hg = number(n, optarg, 0, 1); break;
        case 3: o.guidance = choice(n, optarg, "on", "off"); break;
        case 4: o.failure_time = number(n, optarg, 0, 1e4); break;
        case 5: o.paper_sensors = choice(n, optarg, "paper", "exact"); break;
        case 6:
            if (optind >= argc) {
                fputs("--window: wants FROM and TO\n", stderr);
                exit(2);
            }
            o.window_from = number(n, optarg, 0, 1e5);
            o.window_to = number(n, argv[optind++], o.window_from, 1e5);
            break;
        case 7: o.duration = number(n, optarg, TICK, 1e4); break;
        case 8: o.repeat = (long)number(n, optarg, 1, 1e6); break;
        case 9: o.trace = optarg; break;
        case 11: o.hands_over = choice(n, optarg, "input", "torque"); break;
        case 12: o.takes_over = number(n, optarg, 0, 10); break;
        case 13: o.follow = number(n, optarg, 0, 10); break;
        case 14: o.hold = number(n, optarg, 0, 10); break;
        case 15: o.fall = number(n, optarg, TICK, 10); break;
        default: usage(stdout); exit(0);
        }
    }
    if (optind < argc) {
        fprintf(stderr, "unknown argument '%s'\n", argv[optind]);
        exit(2);
    }
    return o;
}

/* Of the processor, so that a run beside other work is timed like one alone. */
static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void print_number(const char *name, double value, bool known)
{
    if (known)
        printf("\"%s\": %.9g, ", name, value);
    else
        printf("\"%s\": null, ", name);
}

int main(int argc, char **argv)
{
    const Options o = parse(argc, argv);
    build_crc();
    const Road road = build_road();
    const Plant plant = discretise();
    const long samples = (long)(1.1 * road.length / (SPEED * TICK * SAMPLE_EVERY));
    Sample *sample = malloc((size_t)samples * sizeof *sample);
    if (!sample) {
        fputs("out of memory\n", stderr);
        return 1;
    }

    if (o.trace) {
        FILE *trace = fopen(o.trace, "w");
        if (!trace) {
            perror(o.trace);
            return 2;
        }
        fprintf(trace, "# Independent float64 closed loop, bench/closed_loop.c, every 0.5 s. Made by: closed_loop");
        for (int i = 1; i < argc; i++)
            fprintf(trace, " %s", argv[i]);
        fprintf(trace, "\nt_s,s_m,lateral_error_m,guidance_torque_nm,driver_torque_nm,wheel_angle_rad\n");
        run(&o, &road, &plant, sample, samples, trace);
        if (fclose(trace)) {
            perror(o.trace);
            return 2;
        }
    }
    double spent = INFINITY;
    Result r = {0};
    for (long i = 0; i < o.repeat; i++) {
        double start = now();
        r = run(&o, &road, &plant, sample, samples, NULL);
        spent = fmin(spent, now() - start);
        __asm__ volatile("" : : "r"(sample) : "memory"); /* a reader for the samples, so that they are written */
    }
    const double simulated = (double)r.steps * TICK;
    const bool seen = r.window_ticks > 0;
    printf("{\"program\": \"c\", \"sensors\": \"%s\", \"guidance\": %s, ", o.paper_sensors ? "paper" : "exact",
           o.guidance ? "true" : "false");
    print_number("t_p", o.t_p, true);
    print_number("k_d", o.k_d, true);
    print_number("k_hg", o.k_hg, true);
    print_number("failure_time_s", o.failure_time, !isnan(o.failure_time));
    print_number("simulated_seconds", simulated, true);
    print_number("processor_seconds", spent, true);
    print_number("times_real_time", simulated / spent, true);
    print_number("peak_lateral_error_m", r.peak, seen);
    print_number("mean_abs_lateral_error_m", r.sum / (double)r.window_ticks, seen);
    print_number("peak_guidance_torque_nm", r.peak_t_h, seen);
    print_number("peak_driver_torque_nm", r.peak_t_d, seen);
    print_number("column_sum", r.column_sum, true);
    printf("\"steps\": %ld, \"frames\": %ld, \"frames_rejected\": %ld, \"diverged\": %s}\n", r.steps, r.frames,
           r.rejected, r.diverged ? "true" : "false");
    free(sample);
    free(road.cell);
    return 0;
}
