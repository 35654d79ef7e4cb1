//! What vehicle and column do, simulated over the rows of a drive: equations (1) to (5) with the lateral velocity in the place of
//! the side-slip angle, so that the speed may change, and with dry friction after Dahl.
//!
//! The yaw rate is simulated from the measured wheel angle, the wheel angle from the measured torques. Parameters are in a form in
//! which ranges of vehicles of every size are alike ([`P`]).

use nalgebra::{DVector, SMatrix};

use super::fit::{BLOCK_RATE_HZ, Stretches};
use super::log::{Stretch, VehicleLog};

const GRAVITY_M_PER_S2: f64 = 9.81;
/// Wheel angle at which the friction gives way, rad: 0.2 degrees. A quantised angle does not tell it.
const GIVE_RAD: f64 = 0.003_490_658_503_988_659;
/// Longest step of the column with friction, s.
const LONGEST_STEP_S: f64 = 0.0026;
/// What the start of a stretch, where the motion is not known, moves dies down in so many seconds.
const SETTLING_S: f64 = 1.5;

/// What is known of the vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Known {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Distance of the axles, m.
    pub wheelbase_m: f64,
    /// Centre of gravity to the front axle, m, if it is known.
    pub l_f_m: Option<f64>,
    /// Yaw inertia, kg.m2, if it is known.
    pub yaw_inertia_kg_m2: Option<f64>,
    /// Angle of the steering wheel per angle of the front wheels, if it is known.
    pub steering_ratio: Option<f64>,
}

/// Places of the parameters.
pub(super) mod place {
    /// Logarithm of K_t.
    pub(in super::super) const K_T: usize = 0;
    /// Logarithm of an axle's stiffness over its load, front.
    pub(in super::super) const FRONT: usize = 1;
    /// Logarithm of an axle's stiffness over its load, rear.
    pub(in super::super) const REAR: usize = 2;
    /// Logarithm of the yaw inertia over m*l_f*l_r.
    pub(in super::super) const INERTIA: usize = 3;
    /// l_f over the wheelbase.
    pub(in super::super) const L_F: usize = 4;
    /// What the angle sensor shows when the wheels stand straight, rad.
    pub(in super::super) const ANGLE_OFFSET: usize = 5;
    /// What the gyroscope shows on a straight, rad/s.
    pub(in super::super) const YAW_OFFSET: usize = 6;
    /// By how much the yaw rate is recorded later than the angle, s.
    pub(in super::super) const YAW_DELAY: usize = 7;
    /// Parameters of the vehicle.
    pub(in super::super) const VEHICLE: usize = 8;
    /// Logarithm of J_s, kg.m2.
    pub(in super::super) const J_S: usize = 8;
    /// Logarithm of B_s, N.m.s/rad.
    pub(in super::super) const B_S: usize = 9;
    /// Dry friction, N.m.
    pub(in super::super) const FRICTION: usize = 10;
    /// Logarithm of the aligning torque per lateral acceleration, N.m per m/s2.
    pub(in super::super) const ALIGNING: usize = 11;
    /// What the torque sensors show beside the torque, N.m, turned round.
    pub(in super::super) const TORQUE_OFFSET: usize = 12;
    /// Share of the trail that is lost at a lateral acceleration of g, if it fell with its square.
    pub(in super::super) const TRAIL_FALL: usize = 13;
    /// By how much the angle is recorded later than the torques, s.
    pub(in super::super) const ANGLE_DELAY: usize = 14;
    /// All parameters.
    pub(in super::super) const ALL: usize = 15;
}
use place as P;

/// Parameters in SI units, of one vector of parameters.
#[derive(Debug, Clone, Copy)]
pub(super) struct Physical {
    pub(super) k_t: f64,
    pub(super) m: f64,
    pub(super) i: f64,
    pub(super) l_f: f64,
    pub(super) l_r: f64,
    pub(super) k_f: f64,
    pub(super) k_r: f64,
    /// Aligning torque per side force of the front axle, N.m/N.
    lever: f64,
    j_s: f64,
    b_s: f64,
}

impl Physical {
    /// `x` may end behind the vehicle's parameters.
    pub(super) fn of(known: &Known, x: &DVector<f64>) -> Self {
        let (m, l) = (known.mass_kg, known.wheelbase_m);
        let l_f = x[P::L_F] * l;
        let l_r = l - l_f;
        let load = |other: f64| 0.5 * m * GRAVITY_M_PER_S2 * other / l;
        let column = |place: usize| x.get(place).map_or(1.0, |x| x.exp());
        Self {
            k_t: x[P::K_T].exp(),
            m,
            i: x[P::INERTIA].exp() * m * l_f * l_r,
            l_f,
            l_r,
            k_f: x[P::FRONT].exp() * load(l_r),
            k_r: x[P::REAR].exp() * load(l_f),
            lever: column(P::ALIGNING) * l / (m * l_r),
            j_s: column(P::J_S),
            b_s: column(P::B_S),
        }
    }

    /// K_aln of equation (4), N.m/rad.
    pub(super) fn aligning_stiffness(&self) -> f64 {
        2.0 * self.k_f * self.lever
    }

    /// Angle of the front wheels per lateral acceleration beside that of a crawl, rad per m/s2.
    pub(super) fn understeer_gradient(&self) -> f64 {
        self.m * (self.l_r * self.k_r - self.l_f * self.k_f)
            / (2.0 * (self.l_f + self.l_r) * self.k_f * self.k_r)
    }

    /// Yaw rate per angle of the steering wheel in a steady turn, 1/s.
    pub(super) fn yaw_rate_gain(&self, v: f64) -> f64 {
        v * self.k_t / (self.l_f + self.l_r + self.understeer_gradient() * v * v)
    }

    /// Aligning torque per lateral acceleration in a steady turn, N.m per m/s2.
    pub(super) fn aligning_gain(&self) -> f64 {
        self.lever * self.m * self.l_r / (self.l_f + self.l_r)
    }

    /// J_s, kg.m2.
    pub(super) const fn column_inertia(&self) -> f64 {
        self.j_s
    }

    /// Time in which the yaw rate of a neutral vehicle follows the wheel at 1 m/s, s per m/s.
    pub(super) fn yaw_time(&self) -> f64 {
        self.i / (2.0 * (self.l_f + self.l_r) * self.l_f * self.k_f)
    }

    /// Rates of lateral velocity and yaw rate by both and by the angle of the front wheels.
    fn lateral(&self, v: f64) -> [[f64; 3]; 2] {
        let Self {
            m,
            i,
            l_f,
            l_r,
            k_f,
            k_r,
            ..
        } = *self;
        let moment = l_f * k_f - l_r * k_r;
        [
            [
                -2.0 * (k_f + k_r) / (m * v),
                -v - 2.0 * moment / (m * v),
                2.0 * k_f / m,
            ],
            [
                -2.0 * moment / (i * v),
                -2.0 * (l_f * l_f * k_f + l_r * l_r * k_r) / (i * v),
                2.0 * l_f * k_f / i,
            ],
        ]
    }

    /// Lateral velocity in a steady turn.
    fn steady_lateral(&self, v: f64, yaw_rate: f64) -> f64 {
        let [w, r, delta] = self.lateral(v)[0];
        let wheel = yaw_rate * (self.l_f + self.l_r + self.understeer_gradient() * v * v) / v;
        -(r * yaw_rate + delta * wheel) / w
    }
}

/// Rows in a block, and blocks that are left out at the start of a stretch.
fn blocks(log: &VehicleLog) -> (usize, usize) {
    let rows = ((1.0 / log.step_s / BLOCK_RATE_HZ).round() as usize).max(1);
    (rows, (SETTLING_S / (rows as f64 * log.step_s)).ceil() as usize)
}

/// Means of blocks, of what was measured or simulated on every row.
fn averaged(log: &VehicleLog, rows: &[f64]) -> Vec<f64> {
    let (count, skipped) = blocks(log);
    let whole = rows.chunks_exact(count).skip(skipped);
    whole
        .map(|block| block.iter().sum::<f64>() / count as f64)
        .collect()
}

/// What was recorded a little later: to first order.
fn delayed(rows: &mut Vec<f64>, delay_rows: f64) {
    let last = rows.len() - 1;
    let slope = |k: usize| 0.5 * (rows[(k + 1).min(last)] - rows[k.max(1) - 1]);
    *rows = (0..=last).map(|k| rows[k] - delay_rows * slope(k)).collect();
}

/// A measured signal in blocks.
pub(super) fn measured(log: &VehicleLog, of: fn(&Stretch) -> &Vec<f64>) -> Stretches {
    log.stretches.iter().map(|s| averaged(log, of(s))).collect()
}

/// The yaw rate that the wheel angle makes.
pub(super) fn yaw_rate(log: &VehicleLog, known: &Known, x: &DVector<f64>) -> Stretches {
    let physical = Physical::of(known, x);
    let steps: Vec<SMatrix<f64, 2, 4>> = log
        .speeds
        .iter()
        .map(|v| yaw_step(&physical, *v, log.step_s))
        .collect();
    let one = |s: &Stretch| {
        let mut r = s.yaw_rate[0] - x[P::YAW_OFFSET];
        let mut w = physical.steady_lateral(s.speed[0], r);
        let mut rows = vec![r];
        for k in 1..s.wheel_rad.len() {
            let [from, to] = [k - 1, k].map(|k| physical.k_t * (s.wheel_rad[k] - x[P::ANGLE_OFFSET]));
            let step = &steps[s.bin[k - 1]];
            let next = |row: usize| {
                step[(row, 0)] * w + step[(row, 1)] * r + step[(row, 2)] * from + step[(row, 3)] * (to - from)
            };
            (w, r) = (next(0), next(1));
            rows.push(r);
        }
        delayed(&mut rows, x[P::YAW_DELAY] / log.step_s);
        rows.iter_mut().for_each(|r| *r += x[P::YAW_OFFSET]);
        averaged(log, &rows)
    };
    log.stretches.iter().map(one).collect()
}

/// A step of lateral velocity and yaw rate while the angle of the front wheels goes straight from one value to the next: what both, the
/// first value and the change add.
fn yaw_step(physical: &Physical, v: f64, step_s: f64) -> SMatrix<f64, 2, 4> {
    if v <= 0.0 {
        // A bin that no row has.
        return SMatrix::zeros();
    }
    let mut a = SMatrix::<f64, 4, 4>::zeros();
    for (row, entries) in physical.lateral(v).iter().enumerate() {
        for (column, entry) in entries.iter().enumerate() {
            a[(row, column)] = entry * step_s;
        }
    }
    a[(2, 3)] = 1.0;
    a.exp().fixed_rows::<2>(0).into()
}

/// A step of the column with its vehicle: what lateral velocity, yaw rate, angle, rate, the torque at the start, its change, and what is held
/// add to each of the first four.
type ColumnStep = [[f64; 4]; 7];

fn column_step(physical: &Physical, v: f64, step_s: f64) -> ColumnStep {
    if v <= 0.0 {
        return ColumnStep::default();
    }
    let mut a = SMatrix::<f64, 6, 6>::zeros();
    for (row, [w, r, delta]) in physical.lateral(v).into_iter().enumerate() {
        (a[(row, 0)], a[(row, 1)], a[(row, 2)]) = (w, r, delta * physical.k_t);
    }
    let stiffness = physical.aligning_stiffness();
    let j = physical.j_s;
    a[(2, 3)] = 1.0;
    a[(3, 0)] = stiffness / v / j;
    a[(3, 1)] = stiffness * physical.l_f / v / j;
    a[(3, 2)] = -stiffness * physical.k_t / j;
    a[(3, 3)] = -physical.b_s / j;
    a[(3, 4)] = 1.0 / j;
    a *= step_s;
    a[(4, 5)] = 1.0;
    let whole = a.exp();
    [0, 1, 2, 3, 4, 5, 4].map(|column| std::array::from_fn(|row| whole[(row, column)]))
}

/// The wheel angle that the torques make.
pub(super) fn wheel_angle(log: &VehicleLog, known: &Known, x: &DVector<f64>) -> Stretches {
    let physical = Physical::of(known, x);
    let parts = (log.step_s / LONGEST_STEP_S).ceil().max(1.0);
    let step_s = log.step_s / parts;
    let steps: Vec<ColumnStep> = log
        .speeds
        .iter()
        .map(|v| column_step(&physical, *v, step_s))
        .collect();
    let one = |s: &Stretch| {
        let torque = s.torque_nm.as_deref().unwrap_or(&[]);
        let mut column = Column::at_start(log, s, &physical, x);
        let mut rows = vec![column.state[2]];
        for k in 1..torque.len() {
            let step = &steps[s.bin[k - 1]];
            let change = (torque[k] - torque[k - 1]) / parts;
            for part in 0..parts as usize {
                let now = torque[k - 1] + part as f64 * change + x[P::TORQUE_OFFSET];
                column.advance(step, [now, change], s.speed[k - 1], step_s);
            }
            rows.push(column.state[2]);
        }
        delayed(&mut rows, x[P::ANGLE_DELAY] / log.step_s);
        rows.iter_mut().for_each(|angle| *angle += x[P::ANGLE_OFFSET]);
        averaged(log, &rows)
    };
    log.stretches.iter().map(one).collect()
}

/// The column on its way.
struct Column<'a> {
    physical: &'a Physical,
    friction_nm: f64,
    trail_fall: f64,
    deflection_rad: f64,
    state: [f64; 4],
}

impl<'a> Column<'a> {
    fn at_start(log: &VehicleLog, s: &Stretch, physical: &'a Physical, x: &DVector<f64>) -> Self {
        let few = ((0.1 / log.step_s) as usize).max(1);
        let mean = |rows: &[f64]| rows.iter().sum::<f64>() / rows.len() as f64;
        let r = mean(&s.yaw_rate[..few]) - x[P::YAW_OFFSET];
        let rate = (s.wheel_rad[2 * few] - s.wheel_rad[0]) / (2.0 * few as f64 * log.step_s);
        let angle = s.wheel_rad[0] - x[P::ANGLE_OFFSET];
        Self {
            physical,
            friction_nm: x[P::FRICTION],
            trail_fall: x[P::TRAIL_FALL],
            deflection_rad: 0.0,
            state: [physical.steady_lateral(s.speed[0], r), r, angle, rate],
        }
    }

    fn advance(&mut self, step: &ColumnStep, [torque, change]: [f64; 2], v: f64, step_s: f64) {
        let Physical {
            k_f,
            k_t,
            l_f,
            l_r,
            m,
            lever,
            ..
        } = *self.physical;
        let [w, r, angle, rate] = self.state;
        let front_n = 2.0 * k_f * (k_t * angle - (w + l_f * r) / v);
        let share_of_g = front_n * (l_f + l_r) / (m * l_r * GRAVITY_M_PER_S2);
        // A simulation that runs away is no reason to overflow.
        let fall = (self.trail_fall * share_of_g * share_of_g).clamp(-1.0, 1.0);
        let half_way = self.deflected(rate, 0.5 * step_s);
        let held = lever * front_n * fall - self.friction_nm * half_way / GIVE_RAD;
        let mut next = [0.0; 4];
        for (column, x) in step.iter().zip([w, r, angle, rate, torque, change, held]) {
            for (sum, entry) in next.iter_mut().zip(column) {
                *sum += entry * x;
            }
        }
        self.deflection_rad = self.deflected(0.5 * (rate + next[3]), step_s);
        self.state = next;
    }

    /// The friction's deflection after some time at a rate.
    fn deflected(&self, rate: f64, time_s: f64) -> f64 {
        let end = GIVE_RAD.copysign(rate);
        end + (self.deflection_rad - end) * (-rate.abs() * time_s / GIVE_RAD).exp()
    }
}
