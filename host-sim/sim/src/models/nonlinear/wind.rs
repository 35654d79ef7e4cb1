//! Wind from the side: a steady part, and gusts as coloured noise with a seed of their own.

use rand::SeedableRng;
use rand::rngs::Xoshiro256PlusPlus;
use rand_distr::{Distribution, StandardNormal};

use super::WorldParameters;
use crate::models::STEP_S;

/// Draws the wind of every step.
#[derive(Debug, Clone)]
pub struct Wind {
    steady_n: f64,
    /// Yaw moment per side force, m.
    lever_m: f64,
    decay: f64,
    scale_n: f64,
    gust_n: f64,
    generator: Xoshiro256PlusPlus,
}

impl Wind {
    pub(in crate::models) fn new(world: &WorldParameters, seed: u64) -> Self {
        let decay = (-std::f64::consts::TAU * world.gust_corner_hz * STEP_S).exp();
        Self {
            steady_n: world.wind_n,
            lever_m: world.wind_lever_m,
            decay,
            scale_n: world.gust_sd_n * (1.0 - decay * decay).sqrt(),
            gust_n: 0.0,
            generator: Xoshiro256PlusPlus::seed_from_u64(seed),
        }
    }

    /// Side force (N, to the left) and yaw moment (N.m) of this step.
    pub fn step(&mut self) -> [f64; 2] {
        if self.scale_n != 0.0 {
            let white: f64 = StandardNormal.sample(&mut self.generator);
            self.gust_n = self.decay * self.gust_n + self.scale_n * white;
        }
        let force_n = self.steady_n + self.gust_n;
        [force_n, force_n * self.lever_m]
    }
}
