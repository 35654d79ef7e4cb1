//! The linear form: resonances, transfer functions, and margins of the loops through assist and driver.

use std::f64::consts::{PI, TAU};

use haptic_sim::models::driver::{ArmGains, DriverParameters};
use haptic_sim::models::torsion_bar::{
    Assist, BarPlant, COLUMN_GIVE, GUIDANCE, INPUTS, LAG, LATERAL, MOTOR, SENSOR, STATES, State, WHEEL,
    WHEEL_GIVE, WHEEL_RATE, YAW, YAW_RATE, matrices,
};
use nalgebra::{Complex, DMatrix, DVector, SMatrix};
use serde::Serialize;

/// Frequencies that margins are looked for at, Hz, and how many on each decade.
const FROM_HZ: f64 = 0.01;
const DECADES: u32 = 5;
const A_DECADE: u32 = 400;

/// Who holds the wheel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Hands {
    /// Nobody.
    Free,
    /// Somebody who does not let it turn.
    Fixed,
    /// The arm of equation (8), whose target stays: it has K_nms, t_nms and K_hg.
    Arm {
        /// K_nms, N.m/rad.
        k_nms: f64,
        /// t_nms, s.
        t_nms: f64,
    },
}

impl Hands {
    /// A driver's arm.
    pub fn of(driver: &DriverParameters) -> Self {
        Self::Arm {
            k_nms: driver.k_nms,
            t_nms: driver.t_nms,
        }
    }
}

/// How far a loop is from swinging.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Margins {
    /// The factor on the loop's gain at which it swings, the nearest above 1; none if no larger gain makes it swing.
    pub gain: Option<f64>,
    /// The least phase that the loop may lose, degrees; none if its gain is nowhere 1.
    pub phase_deg: Option<f64>,
    /// Where that is, Hz.
    pub at_hz: Option<f64>,
    /// The largest of 1/|1 + L|: how much the loop enlarges a disturbance.
    pub sensitivity: f64,
}

/// A column at a speed, with an assist that has one slope.
#[derive(Debug, Clone)]
pub struct Linear {
    a: SMatrix<f64, STATES, STATES>,
    b: SMatrix<f64, STATES, INPUTS>,
    v_m_per_s: f64,
    /// What of each state is in the torque behind the compensator.
    compensated: State,
    slope: f64,
}

impl Linear {
    /// The column of a plant at a speed, its assist at a working point of that torque of the bar. Friction, noise, range and limit are
    /// left out.
    pub fn new(plant: &BarPlant, v_m_per_s: f64, torque_nm: f64) -> Self {
        let slope = plant.assist.slope(torque_nm, v_m_per_s);
        let smooth = plant.frictionless(Assist::Slope(slope));
        let (a, b) = matrices(&smooth, v_m_per_s);
        let lead = smooth.motor.lead_s / smooth.motor.lag_s;
        let mut compensated = [0.0; STATES];
        (compensated[SENSOR], compensated[LAG]) = (lead, 1.0 - lead);
        Self {
            a,
            b,
            v_m_per_s,
            compensated,
            slope,
        }
    }

    /// The states that move under such hands; the friction's and psi drive nothing.
    fn moving(hands: Hands) -> Vec<usize> {
        let still = |state: &usize| {
            [WHEEL_GIVE, COLUMN_GIVE, YAW, GUIDANCE].contains(state)
                || (hands == Hands::Fixed && [WHEEL, WHEEL_RATE].contains(state))
        };
        (0..STATES).filter(|state| !still(state)).collect()
    }

    /// The matrix of the moving states under such hands; an arm is one more.
    fn held(&self, hands: Hands) -> (Vec<usize>, DMatrix<f64>) {
        let states = Self::moving(hands);
        let n = states.len();
        let mut a = DMatrix::from_fn(n, n, |row, column| self.a[(states[row], states[column])]);
        if let Hands::Arm { k_nms, t_nms } = hands {
            a = a.resize(n + 1, n + 1, 0.0);
            let place = |state| states.iter().position(|s| *s == state).unwrap_or_default();
            a[(n, n)] = -1.0 / t_nms;
            a[(n, place(WHEEL))] = -k_nms / t_nms;
            a[(place(WHEEL_RATE), n)] = self.b[(WHEEL_RATE, 0)];
        }
        (states, a)
    }

    /// The eigenvalues, 1/s, as real and imaginary parts.
    pub fn eigenvalues(&self, hands: Hands) -> Vec<[f64; 2]> {
        let (_, a) = self.held(hands);
        a.complex_eigenvalues().iter().map(|z| [z.re, z.im]).collect()
    }

    /// Whether what was disturbed comes to rest.
    pub fn is_stable(&self, hands: Hands) -> bool {
        self.eigenvalues(hands).iter().all(|[real, _]| *real < 0.0)
    }

    /// What the states answer at a complex frequency to a column of inputs, one for each of [`STATES`].
    fn answer(
        &self,
        hands: Hands,
        s: Complex<f64>,
        input: &State,
        arm: f64,
    ) -> Option<[Complex<f64>; STATES]> {
        let (states, a) = self.held(hands);
        let n = a.nrows();
        let m = DMatrix::from_fn(n, n, |row, column| {
            let own = if row == column { s } else { Complex::new(0.0, 0.0) };
            own - Complex::new(a[(row, column)], 0.0)
        });
        let right = DVector::from_fn(n, |row, _| {
            Complex::new(states.get(row).map_or(arm, |state| input[*state]), 0.0)
        });
        let x = m.lu().solve(&right)?;
        let mut all = [Complex::new(0.0, 0.0); STATES];
        for (place, state) in states.iter().enumerate() {
            all[*state] = x[place];
        }
        Some(all)
    }

    /// The torque of the bar for 1 N.m of T_h at a frequency, Hz, and of the motor's whole torque beside T_h: what hands at the wheel
    /// feel of the guidance, and what the assist takes away or adds. An arm answers with its K_hg of what it feels.
    pub fn guidance(&self, hands: Hands, k_hg: f64, hz: f64) -> Option<[Complex<f64>; 2]> {
        let s = Complex::new(0.0, TAU * hz);
        let arm = match hands {
            Hands::Arm { t_nms, .. } => 1.0 / t_nms,
            Hands::Free | Hands::Fixed => 0.0,
        };
        let by_motor = std::array::from_fn(|row| self.b[(row, 1)]);
        // The arm feels the guidance's part of the motor through the bar ([`BarPlant::felt_nm`]).
        let part = Complex::new(self.b[(GUIDANCE, 1)], 0.0) / (s - self.a[(GUIDANCE, GUIDANCE)]);
        let felt = part / (1.0 + self.slope);
        let direct = self.answer(hands, s, &by_motor, 0.0)?;
        let by_arm = self.answer(hands, s, &[0.0; STATES], arm)?;
        let total = |state: usize| direct[state] - felt * by_arm[state] * k_hg;
        // The sensor is as stiff as the bar but for its lag.
        let bar = total(SENSOR) * (Complex::new(1.0, 0.0) - s / self.a[(SENSOR, SENSOR)]);
        Some([bar, total(MOTOR)])
    }

    /// The loop through the assist, opened at the motor, at a frequency: L(jw).
    pub fn assist_loop(&self, hands: Hands, hz: f64) -> Option<Complex<f64>> {
        let mut open = self.clone();
        // Without what the assist asks of the motor, but as it is asked.
        for state in [SENSOR, LAG] {
            open.a[(MOTOR, state)] -= self.slope * self.compensated[state] * -open.a[(MOTOR, MOTOR)];
        }
        let mut input = [0.0; STATES];
        input[MOTOR] = -self.a[(MOTOR, MOTOR)];
        let x = open.answer(hands, Complex::new(0.0, TAU * hz), &input, 0.0)?;
        let behind: Complex<f64> = x.iter().zip(self.compensated).map(|(x, share)| x * share).sum();
        Some(-self.slope * behind)
    }

    /// The loop through a driver's eyes (7) and arm (8) on a straight, opened at the target angle, at a frequency: L(jw).
    pub fn driver_loop(&self, driver: &DriverParameters, gains: ArmGains, hz: f64) -> Option<Complex<f64>> {
        let s = Complex::new(0.0, TAU * hz);
        let arm = (gains.k_d + driver.k_nms) / driver.t_nms;
        let x = self.answer(Hands::of(driver), s, &[0.0; STATES], arm)?;
        let v = self.v_m_per_s;
        let direction = x[YAW_RATE] / s + x[LATERAL] / v;
        let e_y = -(direction * v / s + direction * (v * driver.t_n));
        let e_theta = -direction;
        let seen = e_y * driver.a_1 + e_y / s * driver.a_2 + e_theta * driver.a_3;
        Some(-seen * (-s * driver.t_p).exp())
    }
}

/// The margins of a loop that is stable when closed; none where it has no answer at some frequency.
pub fn margins(at: impl Fn(f64) -> Option<Complex<f64>>) -> Option<Margins> {
    let hz = |k: u32| FROM_HZ * 10_f64.powf(f64::from(k) / f64::from(A_DECADE));
    let points: Vec<(f64, Complex<f64>)> = (0..=DECADES * A_DECADE)
        .map(|k| Some((hz(k), at(hz(k))?)))
        .collect::<Option<_>>()?;
    let mut found = Margins {
        gain: None,
        phase_deg: None,
        at_hz: None,
        sensitivity: 0.0,
    };
    for (_, l) in &points {
        found.sensitivity = found.sensitivity.max(1.0 / (l + 1.0).norm());
    }
    for two in points.windows(2) {
        let [(from, a), (to, b)] = [two[0], two[1]];
        // Where the gain passes 1, and where the loop crosses the negative real axis.
        if (a.norm() - 1.0) * (b.norm() - 1.0) <= 0.0 {
            let (w, l) = crossing(&at, [from, to], |l| l.norm().ln())?;
            // The way to -1, in (-180, 180].
            let left = (l.arg() + PI).rem_euclid(TAU);
            let left = left.min(TAU - left).to_degrees();
            if found.phase_deg.is_none_or(|least| left < least) {
                (found.phase_deg, found.at_hz) = (Some(left), Some(w));
            }
        }
        if a.im * b.im <= 0.0 && a.re < 0.0 && b.re < 0.0 {
            let (_, l) = crossing(&at, [from, to], |l| l.im)?;
            let gain = 1.0 / l.norm();
            if gain > 1.0 && found.gain.is_none_or(|least| gain < least) {
                found.gain = Some(gain);
            }
        }
    }
    Some(found)
}

/// Where something of a loop is 0 between two frequencies, by halving.
fn crossing(
    at: &impl Fn(f64) -> Option<Complex<f64>>,
    [mut low, mut high]: [f64; 2],
    of: fn(Complex<f64>) -> f64,
) -> Option<(f64, Complex<f64>)> {
    let sign = of(at(low)?) > 0.0;
    // 40 halvings of a 400th of a decade are below the digits of f64.
    for _ in 0..40 {
        let middle = (low * high).sqrt();
        if (of(at(middle)?) > 0.0) == sign {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some((low, at(low)?))
}
