//! The rows of the loss, block by block: prediction errors and their negative derivatives, side by side.
//!
//! All columns have gone through the filter of the disturbance, `(1 - rho/q)/(1 - theta/q)`. They are the negative
//! derivatives by the first parameters, in their order, and behind them that by the stretch's constant. The filter starts
//! as if the first row of a stretch had gone on for ever: for the slow signals here that is nearer to the truth than
//! silence, and the first innovation is not the whole disturbance. What is made of the rows is in [`super::sums`].

use std::ops::Range;

use super::{
    CORE, COUNT, D_LATE, DAMPING, H_LATE, K_HG, K_NMS, Line, OWN_BEND, OWN_OFFSET, Problem, RHO, T_NMS, T_P,
    THETA, WHEEL, at,
};
use crate::identify::signals::Delay;
use crate::identify::wide::BLOCK;

/// A block of rows; what lies behind its `count` rows is zero. The last of the columns is the constant's.
pub(super) struct Block<const N: usize> {
    pub(super) count: usize,
    pub(super) columns: [[f64; BLOCK]; N],
    pub(super) errors: [f64; BLOCK],
    /// The disturbance before the filter.
    pub(super) disturbance: [f64; BLOCK],
}

/// A point of the search, for the rows of one stretch.
struct Point<'a> {
    p: &'a [f64],
    delay: Delay,
    line: Line,
    /// By how many rows T_h and the wheel angle are read later.
    late: [f64; 2],
    constant: f64,
}

/// What the filter remembers.
struct Memory<const N: usize> {
    state: [f64; N],
    last: [f64; N],
    error: f64,
    disturbance: f64,
}

impl<const N: usize> Block<N> {
    pub(super) const EMPTY: Self = Self {
        count: 0,
        columns: [[0.0; BLOCK]; N],
        errors: [0.0; BLOCK],
        disturbance: [0.0; BLOCK],
    };

    /// Derivatives by what is always searched, and the disturbance; `arm` is the arm's torque. Plain loops over whole blocks, which
    /// the compiler makes wide; what lies behind the last row is cut off by the filter.
    fn fill(
        &mut self,
        problem: &Problem<'_>,
        point: &Point<'_>,
        rows: &Range<usize>,
        arm: &mut [f64; BLOCK],
    ) {
        let (s, p, first) = (&problem.signals, point.p, rows.start);
        let mut value = [[0.0; BLOCK]; 5];
        let mut slope = [[0.0; BLOCK]; 5];
        let seen = s.visual.iter().chain(&s.road);
        for ((u, value), slope) in seen.zip(&mut value).zip(&mut slope) {
            point.delay.read_block(u, first, value, slope);
        }
        let ([e_y, whole, e_theta, turn, heading], bend) = (&mut value, p[OWN_BEND]);
        let [e_y_late, whole_late, e_theta_late, turn_late, heading_late] = &slope;
        let [mut guidance, mut wheel, mut time, mut torque] = [[0.0; BLOCK]; 4];
        self.count = rows.len();
        for i in 0..self.count {
            guidance[i] = -read(&s.guidance, first + i, point.late[0]);
            wheel[i] = -read(&s.wheel.lagged, first + i, point.late[1]);
            torque[i] = s.torque[first + i];
        }
        let mut by_delay = [0.0; BLOCK];
        let (mut by_offset, mut by_bend) = ([0.0; BLOCK], [0.0; BLOCK]);
        for i in 0..BLOCK {
            time[i] = (first + i) as f64 * s.dt_s;
            e_y[i] += bend * turn[i];
            whole[i] += p[OWN_OFFSET] * time[i] + bend * heading[i];
            arm[i] = p[0] * e_y[i]
                + p[1] * whole[i]
                + p[2] * e_theta[i]
                + p[K_HG] * guidance[i]
                + p[K_NMS] * wheel[i];
            self.disturbance[i] = torque[i] - arm[i] - point.constant;
            by_delay[i] = p[0] * (e_y_late[i] + bend * turn_late[i])
                + p[1] * (whole_late[i] + bend * heading_late[i])
                + p[2] * e_theta_late[i];
        }
        match point.line {
            Line::Size => {
                for i in 0..BLOCK {
                    by_offset[i] = p[1] * time[i];
                    by_bend[i] = p[0] * turn[i] + p[1] * heading[i];
                }
            }
            Line::Torques => (by_offset, by_bend) = (time, *heading),
        }
        let row = [&*e_y, whole, e_theta, &guidance, &by_delay, &by_offset, &by_bend];
        for (column, x) in self.columns[..N - 1].iter_mut().zip(row) {
            *column = *x;
        }
        self.columns[N - 1] = [1.0; BLOCK];
    }

    /// The derivatives by what is usually known; `slow` is the arm's torque through one more lag.
    fn fill_sensors(
        &mut self,
        problem: &Problem<'_>,
        point: &Point<'_>,
        first: usize,
        arm: &[f64; BLOCK],
        slow: &mut Option<f64>,
    ) {
        let (s, p) = (&problem.signals, point.p);
        let decay = (-s.dt_s / s.t_nms_s).exp();
        let rate = |raw: f64, lagged: f64| (raw - lagged) / s.t_nms_s;
        for (i, &arm) in arm.iter().enumerate().take(self.count) {
            let k = first + i;
            let h_rate = p[K_HG] * rate(s.guidance_raw[k], s.guidance[k]);
            let w_rate = p[K_NMS] * rate(s.wheel.raw[k], s.wheel.lagged[k]);
            let lagged = slow.map_or(arm, |slow| decay * slow + (1.0 - decay) * arm);
            *slow = Some(lagged);
            self.columns[K_NMS][i] = -read(&s.wheel.lagged, k, point.late[1]);
            self.columns[T_NMS][i] = -rate(arm, lagged);
            self.columns[H_LATE][i] = -h_rate;
            self.columns[D_LATE][i] = self.columns[T_P][i] + h_rate + w_rate;
            // The torque of the hands holds J phi'' + B phi'.
            self.columns[WHEEL][i] = problem.wheel.map_or(0.0, |w| -w.acceleration[k]);
            self.columns[DAMPING][i] = problem.wheel.map_or(0.0, |w| -w.rate[k]);
        }
    }

    fn filter(&mut self, rho: f64, theta: f64, memory: &mut Option<Memory<N>>) {
        // Those of the disturbance are derivatives of the filter itself.
        let of_filter = |i: usize| i + 1 < N && (RHO..CORE).contains(&i);
        let rho_of: [f64; N] = std::array::from_fn(|i| if of_filter(i) { 0.0 } else { rho });
        let Memory {
            mut state,
            mut last,
            mut error,
            mut disturbance,
        } = memory.take().unwrap_or_else(|| {
            let gain = (1.0 - rho) / (1.0 - theta);
            let last: [f64; N] = std::array::from_fn(|i| if of_filter(i) { 0.0 } else { self.columns[i][0] });
            Memory {
                state: last.map(|x| gain * x),
                last,
                error: gain * self.disturbance[0],
                disturbance: self.disturbance[0],
            }
        });
        for k in 0..self.count {
            if N > CORE {
                self.columns[RHO][k] = disturbance;
                self.columns[THETA][k] = -error;
            }
            for i in 0..N {
                let now = self.columns[i][k];
                state[i] = theta * state[i] + (now - rho_of[i] * last[i]);
                last[i] = now;
                self.columns[i][k] = state[i];
            }
            error = theta * error + (self.disturbance[k] - rho * disturbance);
            disturbance = self.disturbance[k];
            self.errors[k] = error;
        }
        *memory = Some(Memory {
            state,
            last,
            error,
            disturbance,
        });
        for column in self.columns.iter_mut().chain([&mut self.errors]) {
            column[self.count..].fill(0.0);
        }
    }
}

/// `u` at row `k`, read so many rows later.
fn read(u: &[f64], k: usize, late: f64) -> f64 {
    if late == 0.0 { u[k] } else { at(u, k, late) }
}

impl Problem<'_> {
    fn point<'a>(&self, p: &'a [f64], stretch: usize, line: Line) -> Point<'a> {
        let dt_s = self.signals.dt_s;
        Point {
            p,
            line,
            // T_d is recorded late: all that it answers to is as much longer ago.
            delay: self.signals.delay((p[T_P] + p[D_LATE]).max(0.0)),
            late: [(p[H_LATE] - p[D_LATE]) / dt_s, -p[D_LATE] / dt_s],
            constant: p[COUNT + stretch],
        }
    }

    /// Hands each block of rows at `p`, with the number of its stretch, to `visit`.
    pub(super) fn walk<const N: usize>(
        &self,
        p: &[f64],
        line: Line,
        mut visit: impl FnMut(usize, &Block<N>),
    ) {
        let mut block = Block::EMPTY;
        let mut arm = [0.0; BLOCK];
        for (number, stretch) in self.stretches.iter().enumerate() {
            let point = self.point(p, number, line);
            let (mut memory, mut slow) = (None, None);
            for first in stretch.clone().step_by(BLOCK) {
                let rows = first..(first + BLOCK).min(stretch.end);
                block.fill(self, &point, &rows, &mut arm);
                if N > COUNT {
                    block.fill_sensors(self, &point, first, &arm, &mut slow);
                }
                block.filter(p[RHO], p[THETA], &mut memory);
                visit(number, &block);
            }
        }
    }
}
