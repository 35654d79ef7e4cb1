//! The rows of the loss, in blocks that the processor's wide registers are filled with: prediction errors, their
//! derivatives, and the products of those. What is made of them is in [`super::sums`].
//!
//! Columns lie side by side in a row, all through the filter of the disturbance, `(1 - rho/q)/(1 - theta/q)`: eight, or
//! sixteen where what is usually known of muscle and sensors has its derivatives too. They are the negative derivatives
//! by the parameters and, behind them, by the stretch's constant.
//!
//! The filter starts as if the first row of a stretch had gone on for ever: for the slow signals here that is nearer to
//! the truth than silence, and the first innovation is not the whole disturbance.

use std::ops::Range;

use multiversion::multiversion;

use super::{CORE, COUNT, K_HG, RHO, T_P, THETA, at};
use crate::identify::signals::{Delay, Signals};
use crate::identify::wide::{BLOCK, window};

/// Columns side by side, as many as registers hold, for [`CORE`] and for all parameters.
pub(super) const FEW: usize = 8;
pub(super) const MANY: usize = 16;

/// Sums of products of columns; those with the column's own number or a lower one count.
pub(super) type Gram<const L: usize> = [[f64; L]; L];

// What is compiled for several processors has plain loops: iterators and closures would stay calls there.

/// A point of the search, for the rows of one stretch.
pub(super) struct Point {
    pub(super) delay: Delay,
    pub(super) gains: [f64; 3],
    pub(super) k_hg: f64,
    pub(super) k_nms: f64,
    /// By how many rows T_h and the wheel angle are read later.
    pub(super) late: [f64; 2],
    pub(super) rho: f64,
    pub(super) theta: f64,
    pub(super) constant: f64,
}

/// Regressors and disturbance of the rows of a block, before the filter.
pub(super) struct Block {
    visual: [[f64; BLOCK]; 3],
    guidance: [f64; BLOCK],
    by_delay: [f64; BLOCK],
    pub(super) disturbance: [f64; BLOCK],
    wheel: [f64; BLOCK],
    /// The arm's torque.
    arm: [f64; BLOCK],
    /// Derivatives by K_nms, t_nms and the delays of T_h and T_d.
    sensors: [[f64; BLOCK]; 4],
}

impl Block {
    pub(super) const EMPTY: Self = Self {
        visual: [[0.0; BLOCK]; 3],
        guidance: [0.0; BLOCK],
        by_delay: [0.0; BLOCK],
        disturbance: [0.0; BLOCK],
        wheel: [0.0; BLOCK],
        arm: [0.0; BLOCK],
        sensors: [[0.0; BLOCK]; 4],
    };

    #[inline(always)]
    #[expect(clippy::needless_range_loop, reason = "see above")]
    fn fill(&mut self, s: &Signals, p: &Point, rows: Range<usize>) {
        let first = rows.start;
        let mut slopes = [[0.0; BLOCK]; 3];
        for i in 0..3 {
            p.delay
                .read_block(&s.visual[i], first, &mut self.visual[i], &mut slopes[i]);
        }
        let mut spare = [[0.0; BLOCK]; 3];
        let [spare_0, spare_1, spare_2] = &mut spare;
        let guidance = window(&s.guidance, first, spare_0);
        let wheel = window(&s.wheel.lagged, first, spare_1);
        let torque = window(&s.torque, first, spare_2);
        for i in 0..BLOCK {
            self.guidance[i] = -guidance[i];
            self.wheel[i] = -wheel[i];
        }
        if p.late[0] != 0.0 || p.late[1] != 0.0 {
            for i in 0..rows.end - first {
                self.guidance[i] = -at(&s.guidance, first + i, p.late[0]);
                self.wheel[i] = -at(&s.wheel.lagged, first + i, p.late[1]);
            }
        }
        let ([v1, v2, v3], [d1, d2, d3]) = (&self.visual, &slopes);
        for i in 0..BLOCK {
            let visual = p.gains[0] * v1[i] + p.gains[1] * v2[i] + p.gains[2] * v3[i];
            self.arm[i] = visual + p.k_hg * self.guidance[i] + p.k_nms * self.wheel[i];
            self.by_delay[i] = p.gains[0] * d1[i] + p.gains[1] * d2[i] + p.gains[2] * d3[i];
            self.disturbance[i] = torque[i] - self.arm[i] - p.constant;
        }
    }

    /// The derivatives by what is usually known; `slow` is the arm's torque through one more lag.
    pub(super) fn fill_sensors(
        &mut self,
        s: &Signals,
        p: &Point,
        rows: Range<usize>,
        slow: &mut Option<f64>,
    ) {
        let decay = (-s.dt_s / s.t_nms_s).exp();
        let rate = |raw: f64, lagged: f64| (raw - lagged) / s.t_nms_s;
        let [by_k_nms, by_t_nms, by_h_late, by_d_late] = &mut self.sensors;
        for (i, k) in rows.enumerate() {
            let h_rate = p.k_hg * rate(s.guidance_raw[k], s.guidance[k]);
            let w_rate = p.k_nms * rate(s.wheel.raw[k], s.wheel.lagged[k]);
            let arm = self.arm[i];
            let lagged = slow.map_or(arm, |slow| decay * slow + (1.0 - decay) * arm);
            *slow = Some(lagged);
            by_k_nms[i] = self.wheel[i];
            by_t_nms[i] = -rate(arm, lagged);
            by_h_late[i] = -h_rate;
            by_d_late[i] = self.by_delay[i] + h_rate + w_rate;
        }
    }

    /// What a row's columns have in common.
    #[inline(always)]
    fn driver(&self, k: usize) -> [f64; 5] {
        let [v1, v2, v3] = &self.visual;
        [v1[k], v2[k], v3[k], self.guidance[k], self.by_delay[k]]
    }
}

/// What the filters remember, and what they made of the last block.
pub(super) struct Filtered<const L: usize> {
    pub(super) begun: bool,
    state: [f64; L],
    /// What went in before.
    last: [f64; L],
    error: f64,
    last_disturbance: f64,
    pub(super) columns: [[f64; L]; BLOCK],
    pub(super) errors: [f64; BLOCK],
}

impl<const L: usize> Filtered<L> {
    pub(super) const SILENT: Self = Self {
        begun: false,
        state: [0.0; L],
        last: [0.0; L],
        error: 0.0,
        last_disturbance: 0.0,
        columns: [[0.0; L]; BLOCK],
        errors: [0.0; BLOCK],
    };

    /// A row of regressors: zero where the derivative is not one of the row alone.
    #[inline(always)]
    fn regressors(block: &Block, k: usize) -> [f64; L] {
        let mut out = [0.0; L];
        [out[0], out[1], out[2], out[K_HG], out[T_P]] = block.driver(k);
        if L == MANY {
            for i in 0..COUNT - CORE {
                out[CORE + i] = block.sensors[i][k];
            }
            out[COUNT] = 1.0;
        } else {
            out[CORE] = 1.0;
        }
        out
    }

    #[inline(always)]
    fn filter(&mut self, p: &Point, block: &Block, count: usize) {
        let (rho, theta) = (p.rho, p.theta);
        if !self.begun {
            self.begun = true;
            let gain = (1.0 - rho) / (1.0 - theta);
            self.last = Self::regressors(block, 0);
            for i in 0..L {
                self.state[i] = gain * self.last[i];
            }
            self.last_disturbance = block.disturbance[0];
            self.error = gain * self.last_disturbance;
        }
        let (mut state, mut last) = (self.state, self.last);
        let (mut error, mut before) = (self.error, self.last_disturbance);
        for k in 0..count {
            let now = Self::regressors(block, k);
            let mut new = now;
            new[RHO] = before;
            new[THETA] = -error;
            for i in 0..L {
                state[i] = theta * state[i] + (new[i] - rho * last[i]);
            }
            last = now;
            error = theta * error + (block.disturbance[k] - rho * before);
            before = block.disturbance[k];
            self.columns[k] = state;
            self.errors[k] = error;
        }
        (self.state, self.last) = (state, last);
        (self.error, self.last_disturbance) = (error, before);
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn fill(s: &Signals, p: &Point, rows: Range<usize>, block: &mut Block) {
    block.fill(s, p, rows);
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn filter_block<const L: usize>(p: &Point, block: &Block, count: usize, out: &mut Filtered<L>) {
    out.filter(p, block, count);
}

/// Adds the products of some of the columns, numbers `FROM` to `TO`, with the first `WIDTH`: as many sums as the registers
/// hold.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "see above")]
fn products<const L: usize, const FROM: usize, const TO: usize, const WIDTH: usize>(
    gram: &mut Gram<L>,
    rows: &[[f64; L]],
) {
    let mut sums = [[0.0; WIDTH]; L];
    for i in FROM..TO {
        for j in 0..WIDTH {
            sums[i][j] = gram[i][j];
        }
    }
    for k in 0..rows.len() {
        let row = &rows[k];
        for i in FROM..TO {
            for j in 0..WIDTH {
                sums[i][j] += row[i] * row[j];
            }
        }
    }
    for i in FROM..TO {
        for j in 0..WIDTH {
            gram[i][j] = sums[i][j];
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn add_products<const L: usize>(gram: &mut Gram<L>, rows: &[[f64; L]]) {
    products::<L, 0, 4, 4>(gram, rows);
    products::<L, 4, 6, 8>(gram, rows);
    products::<L, 6, 8, 8>(gram, rows);
    if L == MANY {
        products::<L, 8, 10, 12>(gram, rows);
        products::<L, 10, 12, 12>(gram, rows);
    }
}

/// The errors' squares, and their products with the columns.
#[derive(Clone, Copy)]
pub(super) struct OfErrors<const L: usize> {
    pub(super) squares: f64,
    pub(super) by_column: [f64; L],
}

impl<const L: usize> OfErrors<L> {
    pub(super) const NONE: Self = Self {
        squares: 0.0,
        by_column: [0.0; L],
    };

    #[inline(always)]
    #[expect(clippy::needless_range_loop, reason = "see above")]
    fn add(&mut self, rows: &Filtered<L>, count: usize) {
        let mut here = *self;
        for k in 0..count {
            let (row, e) = (&rows.columns[k], rows.errors[k]);
            here.squares += e * e;
            for i in 0..L {
                here.by_column[i] += e * row[i];
            }
        }
        *self = here;
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub(super) fn add_errors<const L: usize>(to: &mut OfErrors<L>, rows: &Filtered<L>, count: usize) {
    to.add(rows, count);
}
