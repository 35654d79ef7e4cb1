//! The paper's driver in the paper's vehicle, as one system.

use super::{Acting, BarState, DriverVehicle, DriverView, Motion, Vehicle};
use crate::models::arm::Arm;
use crate::models::driver::{ArmGains, DriverParameters, Remnant, Vision};
use crate::models::hands_answer::HandsAnswer;
use crate::models::nonlinear::NonlinearPlant;
use crate::models::plant::{Plant, PlantInput, Transition};
use crate::models::step_of;
use crate::models::tolerances::Car;
use crate::models::torsion_bar::{BarPlant, ColumnFault};
use crate::scenario::Scenario;
use crate::seeds::Stream;

/// What moves arm, column and vehicle.
#[derive(Debug, Clone)]
pub enum Mover {
    /// The exact step of the linear plant.
    Linear,
    /// Runge-Kutta, where a scenario asks for what the linear plant cannot do.
    Nonlinear(Box<NonlinearPlant>),
    /// A wheel on a torsion bar, held by an arm that is stepped beside it: angle and felt torque of a step's start hold for it.
    Bar(Box<(BarPlant, Arm)>),
}

/// The driver of equations (7) and (8) whose arm is a state of the vehicle's plant, but with a torsion bar.
#[derive(Debug, Clone)]
pub struct PaperPair {
    look_ahead_s: [f64; 2],
    vision: Vision,
    /// The part of the driver's torque that no model explains.
    pub remnant: Remnant,
    /// How arm, column and vehicle move.
    pub arm: ByReliance<Transition>,
    notices: Notices,
    answer: HandsAnswer,
    takes_over: bool,
    step: u32,
    /// phi_target at the start and at the end of the step, rad.
    target_rad: [f64; 2],
    /// Torque on the column beside the arm's and the guidance's, N.m.
    held_nm: f64,
    plant: Plant,
    /// What moves them.
    pub mover: Mover,
    motor_torque_nm: f64,
}

impl PaperPair {
    /// A scenario's driver in the car that its tolerances draw.
    pub fn new(scenario: &Scenario) -> Self {
        let arm = ByReliance::new(scenario, |gains| transition(scenario, scenario.driver(), gains));
        Self::moved_by(scenario, scenario.driver(), arm)
    }

    /// The car of a scenario with nobody at the wheel: whatever steers it is a hand's torque.
    pub fn without_driver(scenario: &Scenario) -> Self {
        let nobody = DriverParameters {
            a_1: 0.0,
            a_2: 0.0,
            a_3: 0.0,
            k_nms: 0.0,
            remnant_sd_nm: 0.0,
            answers_hands_off_after_s: f64::INFINITY,
            ..*scenario.driver()
        };
        let slack = ArmGains { k_d: 0.0, k_hg: 0.0 };
        let arm = ByReliance::constant(transition(scenario, &nobody, slack));
        Self::moved_by(scenario, &nobody, arm)
    }

    fn moved_by(scenario: &Scenario, driver: &DriverParameters, arm: ByReliance<Transition>) -> Self {
        let Car { world, vehicle, .. } = scenario.car();
        // The linear plant is exact at one speed alone.
        let is_linear = world.is_ideal() && scenario.course().is_level() && !scenario.changes_speed();
        let mover = if scenario.column().has_bar() {
            let arm = Arm::new(driver, scenario.gains());
            Mover::Bar(Box::new((BarPlant::new(scenario), arm)))
        } else if is_linear {
            Mover::Linear
        } else {
            let seed = Stream::World.seed(scenario.seed());
            Mover::Nonlinear(Box::new(NonlinearPlant::new(world, &vehicle, driver, seed)))
        };
        Self {
            look_ahead_s: [driver.t_n, driver.t_f],
            vision: Vision::new(driver),
            remnant: Remnant::new(driver, Stream::Remnant.seed(scenario.seed())),
            arm,
            notices: Notices::new(driver),
            answer: HandsAnswer::new(driver),
            takes_over: false,
            step: 0,
            target_rad: [0.0; 2],
            held_nm: 0.0,
            plant: Plant::default(),
            mover,
            motor_torque_nm: 0.0,
        }
    }

    /// From the next step on the driver is that of another scenario in weights, delay and gains of the arm. Muscle, remnant
    /// and look-ahead stay what they were.
    pub fn change_driver(&mut self, to: &Scenario) {
        self.arm.relying = transition(to, to.driver(), to.gains());
        self.vision.change(to.driver());
    }

    /// Whether the driver drives as manually from now on, as one does who has understood that there is no guidance.
    pub fn take_over(&mut self, takes_over: bool) {
        self.takes_over = takes_over;
    }

    /// Something of a column with a bar fails in the next step; nothing does where there is no bar.
    pub fn fail(&mut self, fault: ColumnFault) {
        if let Mover::Bar(bar) = &mut self.mover {
            bar.0.fail(fault);
        }
    }

    /// Torque of the driver's arm at the start of the next step, without remnant and hand, N.m.
    pub fn arm_torque_nm(&self) -> f64 {
        self.plant.arm_torque_nm()
    }

    /// A torque on the column in the place of a driver's.
    pub(super) fn hold(&mut self, torque_nm: f64) {
        self.held_nm = torque_nm;
    }
}

impl DriverVehicle for PaperPair {
    fn look_ahead_s(&self) -> [f64; 2] {
        self.look_ahead_s
    }

    #[inline]
    fn drive(&mut self, view: &DriverView, hand_torque_nm: f64) -> f64 {
        self.step = view.step;
        self.notices.step(view.is_lost);
        self.target_rad[1] = self.vision.step(view.lane.e_y_m, view.lane.e_theta_rad);
        self.held_nm = self.remnant.step() + hand_torque_nm + self.answer.step(view.asks_for_hands);
        self.plant.arm_torque_nm() + self.held_nm
    }

    #[inline]
    fn advance(&mut self, acting: &Acting) {
        let input = PlantInput {
            target_now_rad: self.target_rad[0],
            target_next_rad: self.target_rad[1],
            guidance_torque_nm: acting.guidance_torque_nm,
            remnant_nm: self.held_nm,
        };
        let is_manual = self.takes_over || self.notices.is_manual();
        let transition = self.arm.at(self.step, is_manual);
        self.motor_torque_nm = match &mut self.mover {
            Mover::Linear => {
                self.plant.step(transition, &input);
                acting.guidance_torque_nm
            }
            Mover::Nonlinear(plant) => {
                let (speeds, gains) = (acting.speed_m_per_s, transition.gains());
                plant.step(&mut self.plant, speeds, gains, input, acting.bank_rad);
                plant.motor_torque_nm()
            }
            Mover::Bar(bar) => {
                let (plant, arm) = bar.as_mut();
                arm.gains = transition.gains();
                let (wheel_rad, felt_nm) = (self.plant.wheel_angle_rad(), plant.felt_nm());
                let hands = Acting {
                    driver_torque_nm: self.plant.arm_torque_nm() + self.held_nm,
                    ..*acting
                };
                let motor_nm = plant.step(&hands);
                self.plant = plant.place(arm.step(self.target_rad[1], wheel_rad, felt_nm));
                motor_nm
            }
        };
        self.target_rad[0] = self.target_rad[1];
    }

    #[inline]
    fn motion(&self) -> Motion {
        let plant = &self.plant;
        Motion {
            position_m: plant.position_m(),
            direction_rad: plant.direction_rad(),
            sideslip_rad: plant.sideslip_rad(),
            yaw_rate_rad_per_s: plant.yaw_rate_rad_per_s(),
            wheel_angle_rad: plant.wheel_angle_rad(),
            wheel_rate_rad_per_s: plant.wheel_rate_rad_per_s(),
        }
    }

    #[inline]
    fn ahead_m(&self, distance_m: f64) -> [f64; 2] {
        self.plant.ahead_m(distance_m)
    }

    #[inline]
    fn motor_torque_nm(&self) -> f64 {
        self.motor_torque_nm
    }

    #[inline]
    fn bar(&self) -> Option<BarState> {
        match &self.mover {
            Mover::Linear | Mover::Nonlinear(_) => None,
            Mover::Bar(bar) => bar.0.bar(),
        }
    }
}

fn transition(scenario: &Scenario, driver: &DriverParameters, gains: ArmGains) -> Transition {
    Transition::new(scenario.speed_m_per_s(), &scenario.car().vehicle, driver, gains)
}

/// What follows from the gains of a driver's arm, for each way in which a scenario has the driver rely on guidance.
#[derive(Debug, Clone)]
pub struct ByReliance<T> {
    relying: T,
    /// From this step on in the place of `relying`.
    changed: Option<(u32, T)>,
    manual: T,
}

impl<T: Clone> ByReliance<T> {
    /// What `of` makes of each of a scenario's gains.
    pub fn new(scenario: &Scenario, of: impl Fn(ArmGains) -> T) -> Self {
        let change = scenario.driver_change();
        Self {
            relying: of(scenario.gains()),
            changed: change.map(|change| (step_of(change.time_s), of(change.gains()))),
            manual: of(scenario.manual_gains()),
        }
    }

    fn constant(always: T) -> Self {
        Self {
            relying: always.clone(),
            changed: None,
            manual: always,
        }
    }
}

impl<T> ByReliance<T> {
    /// The step from which on the driver relies otherwise, if there is one.
    pub fn changes_at(&self) -> Option<u32> {
        self.changed.as_ref().map(|(from, _)| *from)
    }

    /// In a step, for a driver who drives as manually or not.
    #[inline]
    pub fn at(&self, step: u32, is_manual: bool) -> &T {
        match &self.changed {
            _ if is_manual => &self.manual,
            Some((from, changed)) if step >= *from => changed,
            _ => &self.relying,
        }
    }
}

/// A driver who notices after a time that the guidance is lost, and as much later that it is back.
#[derive(Debug, Clone)]
pub(crate) struct Notices {
    /// The time, in steps.
    after: u32,
    is_manual: bool,
    /// Steps for which it has been otherwise than the driver believes.
    unnoticed: u32,
}

impl Notices {
    pub(crate) fn new(driver: &DriverParameters) -> Self {
        Self {
            after: step_of(driver.takes_over_after_s),
            is_manual: false,
            unnoticed: 0,
        }
    }

    #[inline]
    pub(crate) fn step(&mut self, is_lost: bool) {
        if is_lost == self.is_manual {
            self.unnoticed = 0;
        } else if self.unnoticed == self.after {
            (self.is_manual, self.unnoticed) = (is_lost, 0);
        } else {
            self.unnoticed += 1;
        }
    }

    #[inline]
    pub(crate) fn is_manual(&self) -> bool {
        self.is_manual
    }
}
