//! The driver: vision with two points (7), an exact reaction delay, and an arm (8) whose gains can change.
//!
//! The arm's differential equation is part of `plant`; here are its gains, the target angle that it follows,
//! and the remnant, the part of a human's torque that no model explains. Terms: *near* and *far* point, `e_y`
//! and `e_theta` as in section 2.4; a positive error asks for a positive angle.

use rand::SeedableRng;
use rand::rngs::Xoshiro256PlusPlus;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use super::STEP_S;
use crate::fields::{Range, fields};

fields! {
    /// Tables 4, 7 and 8, without remnant. The gains of the arm depend on the condition and are given apart ([`ArmGains`]).
    #[derive(Copy)]
    DriverParameters, "driver" {
        /// visual gain on e_y at the near point, equation (7)
        a_1: f64 = 0.1, "a_1_rad_per_m", "a_1", "rad/m", Between(0.0, 10.0);
        /// visual gain on the integral of e_y
        a_2: f64 = 0.05, "a_2_rad_per_m_s", "a_2", "rad/(m.s)", Between(0.0, 10.0);
        /// visual gain on e_theta at the far point
        a_3: f64 = 3.7, "a_3", "a_3", "", Between(0.0, 100.0);
        /// processing delay
        t_p: f64 = 0.1, "t_p_s", "t_p", "s", Between(STEP_S, 2.0);
        /// look-ahead time of the near point
        t_n: f64 = 0.3, "t_n_s", "t_n", "s", Between(0.0, 5.0);
        /// look-ahead time of the far point
        t_f: f64 = 1.0, "t_f_s", "t_f", "s", Between(0.0, 5.0);
        /// time constant of the arm, equation (8)
        t_nms: f64 = 0.1, "t_nms_s", "t_nms", "s", Between(0.01, 2.0);
        /// reflex gain: stiffness of the arm
        k_nms: f64 = 1.0, "k_nms_nm_per_rad", "K_nms", "N.m/rad", Between(0.0, 100.0);
        /// standard deviation of the torque that no model explains; 0 switches it off
        remnant_sd_nm: f64 = 0.0, "remnant_sd_nm", "", "N.m", Between(0.0, 5.0);
        /// corner of the first-order low-pass that colours it
        remnant_corner_hz: f64 = 0.5, "remnant_corner_hz", "", "Hz", Between(0.01, 100.0);
        /// the ECU, which feels no hand, warns 15 s before it ends guidance: after so long the driver moves the wheel to and
        /// fro, with 0.2 N.m over 1 s; `inf`: never. Our own choice, and so late that only drives differ in which guidance
        /// would end
        answers_hands_off_after_s: f64 = 14.0, "answers_hands_off_after_s", "", "s", Between(0.0, f64::INFINITY);
        /// how long after a loss of torque or lane preview the driver drives as manually (section 5.2: 1 s), and how long after
        /// its end the driver relies on guidance again
        takes_over_after_s: f64 = 1.0, "takes_over_after_s", "", "s", Between(0.0, 10.0);
        /// the driver's own line, left of the lane's middle
        line_m: f64 = 0.0, "line_m", "", "m", Between(-2.0, 2.0);
    }
}

fields! {
    /// The arm in the table of a driver.
    #[derive(Copy)]
    ArmInFile, "driver" {
        /// gain on the target angle; without it the condition's
        k_d: Option<f64> = None, "k_d_nm_per_rad", "K_d", "N.m/rad", ArmGains::K_D;
        /// resistance to the guidance; without it the condition's; with `"manual"` only 0. K_d stays as it is: the paper's
        /// drivers have K_d = 2 + 2 K_hg, and a driver with a small K_hg and a large K_d keeps the lane worse with guidance
        /// than without
        k_hg: Option<f64> = None, "k_hg", "K_hg", "", ArmGains::K_HG;
        /// K_d once the driver has noticed that guidance failed, with K_hg of 0; not that of `condition = "manual"`
        manual_k_d: f64 = ArmGains::MANUAL.k_d, "manual_k_d_nm_per_rad", "", "N.m/rad", ArmGains::K_D;
    }
}

/// How the arm weighs vision against the guidance torque.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ArmGains {
    /// K_d, torque per target angle, N.m/rad.
    pub k_d: f64,
    /// K_hg, share of the guidance torque that the arm works against; near 0 the driver relies on it.
    pub k_hg: f64,
}

impl ArmGains {
    /// Without guidance, or once the driver has understood that it failed.
    pub const MANUAL: Self = Self { k_d: 4.0, k_hg: 0.0 };
    /// What K_d may be, N.m/rad.
    pub(crate) const K_D: Range = Range::Between(0.0, 50.0);
    /// What K_hg may be.
    pub(crate) const K_HG: Range = Range::Between(0.0, 10.0);
}

impl DriverParameters {
    /// The line, m right of the middle: what is taken off e_y, which leaves it as it is to the sign of a zero where there is none.
    pub fn right_m(&self) -> f64 {
        0.0 - self.line_m
    }
}

/// Equation (7) with its delay: errors in, delayed target angle out.
#[derive(Debug, Clone)]
pub struct Vision {
    a_1: f64,
    a_2: f64,
    a_3: f64,
    right_m: f64,
    integral: f64,
    last_e_y_m: f64,
    delay: Delay,
}

impl Vision {
    /// A driver at rest.
    pub fn new(parameters: &DriverParameters) -> Self {
        Self {
            a_1: parameters.a_1,
            a_2: parameters.a_2,
            a_3: parameters.a_3,
            right_m: parameters.right_m(),
            integral: 0.0,
            last_e_y_m: 0.0,
            delay: Delay::new(parameters.t_p),
        }
    }

    /// From here on with the weights, the line and the delay of other parameters; what was seen stays seen.
    pub fn change(&mut self, to: &DriverParameters) {
        (self.a_1, self.a_2, self.a_3) = (to.a_1, to.a_2, to.a_3);
        self.right_m = to.right_m();
        self.delay.change(to.t_p);
    }

    /// Takes the errors of this step; returns phi_target at the end of the step, rad.
    #[inline]
    pub fn step(&mut self, e_y_m: f64, e_theta_rad: f64) -> f64 {
        let e_y_m = e_y_m - self.right_m;
        self.integral += 0.5 * STEP_S * (e_y_m + self.last_e_y_m);
        self.last_e_y_m = e_y_m;
        self.delay
            .step(self.a_1 * e_y_m + self.a_2 * self.integral + self.a_3 * e_theta_rad)
    }
}

/// The whole steps of a delay, and what is left of one.
pub fn delay_steps(delay_s: f64) -> (usize, f64) {
    let steps = delay_s / STEP_S;
    (steps.floor() as usize, steps - steps.floor())
}

/// A pure delay of at least one step, linear between samples; zero before the first.
#[derive(Debug, Clone)]
struct Delay {
    ring: Vec<f64>,
    mask: usize,
    next: usize,
    /// Whole steps, one at least.
    whole: usize,
    /// What is left of a step.
    fraction: f64,
}

impl Delay {
    fn new(delay_s: f64) -> Self {
        let (whole, fraction) = delay_steps(delay_s);
        let size = (whole + 1).next_power_of_two();
        Self {
            ring: vec![0.0; size],
            mask: size - 1,
            next: 0,
            whole,
            fraction,
        }
    }

    /// From here on by another time. What lies farther back than was kept is the oldest that was.
    fn change(&mut self, delay_s: f64) {
        let mut other = Self::new(delay_s);
        let oldest = self.ring.len();
        for back in 1..=other.ring.len() {
            let value = self.ring[self.next.wrapping_sub(back.min(oldest)) & self.mask];
            let place = self.next.wrapping_sub(back) & other.mask;
            other.ring[place] = value;
        }
        other.next = self.next;
        *self = other;
    }

    /// Takes the input at this step, returns the output one step later: so a delay of one step returns it.
    #[inline]
    fn step(&mut self, input: f64) -> f64 {
        self.ring[self.next & self.mask] = input;
        self.next = self.next.wrapping_add(1);
        let newer = self.ring[self.next.wrapping_sub(self.whole) & self.mask];
        let older = self.ring[self.next.wrapping_sub(self.whole + 1) & self.mask];
        newer + self.fraction * (older - newer)
    }
}

/// Coloured noise: white Gaussian noise through a first-order low-pass, exact at the steps and held between.
#[derive(Debug, Clone)]
pub struct Remnant {
    decay: f64,
    scale_nm: f64,
    value_nm: f64,
    generator: Xoshiro256PlusPlus,
}

impl Remnant {
    /// Starts at zero; its standard deviation reaches the given one after a few time constants.
    pub fn new(parameters: &DriverParameters, seed: u64) -> Self {
        let decay = (-std::f64::consts::TAU * parameters.remnant_corner_hz * STEP_S).exp();
        Self {
            decay,
            scale_nm: parameters.remnant_sd_nm * (1.0 - decay * decay).sqrt(),
            value_nm: 0.0,
            generator: Xoshiro256PlusPlus::seed_from_u64(seed),
        }
    }

    /// The torque of this step, N.m.
    #[inline]
    pub fn step(&mut self) -> f64 {
        if self.scale_nm == 0.0 {
            return 0.0;
        }
        let white: f64 = StandardNormal.sample(&mut self.generator);
        self.value_nm = self.decay * self.value_nm + self.scale_nm * white;
        self.value_nm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delay_is_exact_for_whole_and_broken_steps() {
        for (delay_s, steps) in [
            (0.001, 1.0),
            (0.3, 300.0),
            (0.1234, 123.4),
            (0.0015, 1.5),
            (0.5, 500.0),
        ] {
            let mut delay = Delay::new(delay_s);
            for k in 0..2000_u32 {
                let output = delay.step(f64::from(k) + 1.0);
                // The input is the line k + 1 from step 0 on, zero before; the output is one step ahead.
                let expected = f64::from(k) + 2.0 - steps;
                if expected >= 1.0 {
                    assert!(
                        (output - expected).abs() < 1e-9,
                        "{delay_s} s, step {k}: {output}"
                    );
                } else if expected <= 0.0 {
                    assert_eq!(output, 0.0, "{delay_s} s, step {k}");
                }
            }
        }
    }

    /// A line comes out later or sooner by the difference of the delays, once the longer one has filled.
    #[test]
    fn a_delay_that_changes_keeps_what_it_has_seen() {
        for [before, after] in [[0.3, 0.1], [0.1, 0.1207], [0.1, 0.3]] {
            let mut delay = Delay::new(before);
            for k in 0..1000_u32 {
                if k == 500 {
                    delay.change(after);
                }
                let output = delay.step(f64::from(k) + 1.0);
                let now = if k < 500 { before } else { after };
                let expected = f64::from(k) + 2.0 - now / STEP_S;
                if k > 300 && (k < 500 || after < before || k > 720) {
                    assert!((output - expected).abs() < 1e-9, "{after} s, step {k}: {output}");
                }
            }
        }
    }

    #[test]
    fn vision_weighs_error_integral_and_yaw() {
        let parameters = DriverParameters {
            t_p: 0.001,
            line_m: 0.1,
            ..Default::default()
        };
        let mut vision = Vision::new(&parameters);
        let mut target = 0.0;
        for _ in 0..2001 {
            target = vision.step(0.3, -0.02);
        }
        // e_y to a line 0.1 m further left: 0.1*0.4 + 0.05*(0.4*2 s + the first half step, 0.0002) - 3.7*0.02
        assert!(
            (target - (0.04 + 0.05 * 0.8002 - 0.074)).abs() < 1e-12,
            "{target}"
        );
    }

    #[test]
    fn the_remnant_has_its_spread_and_its_colour() {
        let parameters = DriverParameters {
            remnant_sd_nm: 0.1,
            ..Default::default()
        };
        let mut remnant = Remnant::new(&parameters, 7);
        let values: Vec<f64> = (0..2_000_000).map(|_| remnant.step()).collect();
        let mean_product = |lag: usize| {
            values.iter().zip(&values[lag..]).map(|(a, b)| a * b).sum::<f64>() / (values.len() - lag) as f64
        };
        // 2000 s hold some 3000 independent values: the variance is known to 3 %.
        assert!((mean_product(0) / 0.01 - 1.0).abs() < 0.1, "{}", mean_product(0));
        // One time constant, 1/(2*pi*0.5 Hz) = 318 ms, later the correlation is 1/e.
        let correlation = mean_product(318) / mean_product(0);
        assert!((correlation - 0.3679).abs() < 0.05, "{correlation}");
        assert_eq!(
            Remnant::new(&parameters, 7).step(),
            values[0],
            "a seed fixes the noise"
        );
        assert_ne!(Remnant::new(&parameters, 8).step(), values[0]);
    }
}
