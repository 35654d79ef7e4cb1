//! A vehicle as a single track: linear tyres, or tyres whose force saturates and whose trail falls with slip.

use super::{GRAVITY_M_PER_S2, Tyres};
use crate::models::vehicle::VehicleParameters;

/// Shape factor of the trail; passenger cars' lie about here.
pub const TRAIL_SHAPE: f64 = 1.2;

/// What a vehicle drives in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surroundings {
    /// Friction between tyre and road.
    pub mu: f64,
    /// Bank, rad, positive where the left edge is the higher one.
    pub bank_rad: f64,
    /// Side force of the wind, N, to the left.
    pub force_n: f64,
    /// Yaw moment of the wind, N.m.
    pub moment_nm: f64,
}

/// What a vehicle does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    /// Rates of lateral velocity (m/s^2) and yaw rate (rad/s^2).
    pub rates: [f64; 2],
    /// Aligning torque on the column, N.m.
    pub aligning_nm: f64,
}

/// Equations (1) to (4), with tyres that may saturate.
#[derive(Debug, Clone)]
pub struct SingleTrack {
    /// Its parameters.
    pub vehicle: VehicleParameters,
    /// How its tyres answer slip.
    pub tyres: Tyres,
    /// Share of the trail that the castor makes: it stays while the pneumatic trail falls.
    pub castor_share: f64,
    /// Aligning torque on the column per side force of the front axle, at no slip, N.m/N.
    pub lever: f64,
    /// Weight on the front and on the rear axle, N.
    pub load_n: [f64; 2],
}

impl SingleTrack {
    /// A vehicle with stiffnesses of table 9's kind, per tyre.
    pub fn new(vehicle: &VehicleParameters, tyres: Tyres, castor_share: f64) -> Self {
        let VehicleParameters { m, l_f, l_r, k_f, .. } = *vehicle;
        let weight = m * GRAVITY_M_PER_S2 / (l_f + l_r);
        Self {
            vehicle: *vehicle,
            tyres,
            castor_share,
            lever: vehicle.aligning_stiffness() / (2.0 * k_f),
            load_n: [weight * l_r, weight * l_f],
        }
    }

    /// Force of an axle, N, for a slip angle.
    ///
    /// It has its stiffness at no slip and nears mu*load where the tyre slides; in between it keeps to the
    /// stiffness for long, as a curve of the fourth order does, so that the stiffness given is that of driving.
    fn axle(&self, stiffness: f64, load_n: f64, mu: f64, slip_rad: f64) -> f64 {
        if self.tyres == Tyres::Linear {
            return stiffness * slip_rad;
        }
        let most = mu * load_n;
        let slip = stiffness * slip_rad / most;
        most * slip / (1.0 + slip.powi(4)).sqrt().sqrt()
    }

    /// The share of an axle's pneumatic trail that is left: it falls earlier than the force, and to nothing, as a cosine
    /// of an arc tangent (Pacejka, Tyre and Vehicle Dynamics, chapter 4).
    fn trail(&self, stiffness: f64, load_n: f64, mu: f64, slip_rad: f64) -> f64 {
        if self.tyres == Tyres::Linear {
            return 1.0;
        }
        let slip = stiffness * slip_rad / (mu * load_n);
        (TRAIL_SHAPE * slip.atan()).cos().max(0.0)
    }
}

impl SingleTrack {
    /// The rates and the torque on the column at a speed, for lateral velocity and yaw rate and a wheel angle.
    pub fn respond(
        &self,
        v_m_per_s: f64,
        [lateral_m_per_s, yaw_rate]: [f64; 2],
        wheel_rad: f64,
        around: &Surroundings,
    ) -> Response {
        let VehicleParameters {
            m,
            i,
            l_f,
            l_r,
            k_f,
            k_r,
            k_t,
            ..
        } = self.vehicle;
        let slip = |lever: f64, steered: f64| {
            let across = lateral_m_per_s + lever * yaw_rate;
            let angle = match self.tyres {
                Tyres::Linear => across / v_m_per_s,
                Tyres::Saturating => across.atan2(v_m_per_s),
            };
            steered - angle
        };
        let front_slip = slip(l_f, k_t * wheel_rad);
        let front = self.axle(2.0 * k_f, self.load_n[0], around.mu, front_slip);
        let trail = self.trail(2.0 * k_f, self.load_n[0], around.mu, front_slip);
        let rear = self.axle(2.0 * k_r, self.load_n[1], around.mu, slip(-l_r, 0.0));
        let gravity = -GRAVITY_M_PER_S2 * around.bank_rad.sin();
        let lever = self.lever * (self.castor_share + (1.0 - self.castor_share) * trail);
        Response {
            rates: [
                (front + rear + around.force_n) / m + gravity - v_m_per_s * yaw_rate,
                (l_f * front - l_r * rear + around.moment_nm) / i,
            ],
            aligning_nm: -lever * front,
        }
    }
}
