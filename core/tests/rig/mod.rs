//! An ECU on a bench: every sender at its period, and a vehicle in a steady curve.
//!
//! In a steady curve the aligning torque is shared by driver and guidance, the near-point error stands still
//! and the far-point error is `t'_f` times the rate of turn, so that no check has anything to say. The numbers
//! are worked out here in f64 from the paper's table 8, not by the core.

#![allow(dead_code, reason = "each test uses its part of the bench")]

pub(crate) mod watch;

use haptic_core::bus::messages::{Column, LanePreview, Message, Request, Telemetry, Vehicle};
use haptic_core::bus::{Frame, Reject};
use haptic_core::controller::config::Setup;
use haptic_core::ecu::injection::InjectedEcu;
use haptic_core::ecu::{Boot, Ecu, Step};
use haptic_core::quantity::{Instant, Metres, Micros, Radians, Ratio, Speed, Torque, TurningRate};
use haptic_core::safety::modes::Mode;

/// 60 km/h.
pub(crate) const SPEED: f64 = 60.0 / 3.6;

/// What the ECU last accepted, and when, us.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Heard {
    pub(crate) driver: Option<(f64, u64)>,
    pub(crate) engage: Option<(bool, u64)>,
    pub(crate) speeds: Option<u64>,
    /// Age of a preview that its sender vouches for, us.
    pub(crate) lane: Option<(u64, u64)>,
}

#[derive(Clone)]
/// Bench state; public fields are what a test turns.
pub(crate) struct Rig {
    pub(crate) ecu: InjectedEcu,
    /// Time since the start; the ECU sees it modulo 2^32 from `clock_start_us`.
    pub(crate) t_us: u64,
    pub(crate) clock_start_us: u32,
    pub(crate) ticks: u64,
    pub(crate) counters: [u8; 4],
    pub(crate) lane: LanePreview,
    pub(crate) speeds: [f64; 2],
    /// The measured yaw rate, if there is one.
    pub(crate) yaw_rate: Option<f64>,
    pub(crate) engage: bool,
    pub(crate) authority: f64,
    pub(crate) probe: bool,
    /// The aligning torque that driver and guidance share, N.m.
    pub(crate) aligning: f64,
    pub(crate) wheel: f64,
    /// The driver's torque, if it is not simply the rest of the aligning torque.
    pub(crate) driver: Option<f64>,
    /// What the motor delivers of the torque commanded.
    pub(crate) motor: fn(f64) -> f64,
    /// Which senders are silent: lane, column, vehicle, request.
    pub(crate) silent: [bool; 4],
    pub(crate) applied: f64,
    /// The last telemetry.
    pub(crate) telemetry: Option<Telemetry>,
    /// Its counter.
    pub(crate) telemetry_counter: u8,
    pub(crate) heard: Heard,
    /// Rejections by the ECU since they were last taken.
    pub(crate) rejects: Vec<Reject>,
}

impl Rig {
    pub(crate) fn new(setup: Option<&Setup>, boot: Boot) -> Self {
        // Three seconds before the microsecond clock wraps.
        let clock_start_us = u32::MAX - 3_000_000;
        Self {
            ecu: InjectedEcu::new(Ecu::new(setup, boot, Instant::from_us(clock_start_us))),
            t_us: 0,
            clock_start_us,
            ticks: 0,
            counters: [0; 4],
            lane: LanePreview {
                valid: true,
                ..LanePreview::default()
            },
            speeds: [SPEED; 2],
            yaw_rate: None,
            engage: false,
            authority: 1.0,
            probe: false,
            aligning: 0.0,
            wheel: 0.0,
            driver: None,
            motor: |torque| torque,
            silent: [false; 4],
            applied: 0.0,
            telemetry: None,
            telemetry_counter: 0,
            heard: Heard::default(),
            rejects: Vec::new(),
        }
    }

    /// A healthy ECU with the paper's parameters.
    pub(crate) fn paper() -> Self {
        Self::new(Some(&Setup::PAPER), Boot::default())
    }

    /// Lane errors, wheel and aligning torque of a steady curve in which the law asks for `torque`.
    pub(crate) fn curve(&mut self, torque: f64) {
        let (curvature_gain, stability, aligning_gain) = (1.0 / 17.0 / 2.635, 0.001_753, 0.987_4);
        let turn_per_wheel = SPEED * curvature_gain / (1.0 + stability * SPEED * SPEED);
        self.wheel = torque / (aligning_gain * SPEED * turn_per_wheel);
        let e_theta = 0.7 * turn_per_wheel * self.wheel;
        // K_1*a1' = 0.5 N.m/m and K_1*a3' = 10 N.m/rad.
        self.lane.e_y = Metres::from_m((torque - 10.0 * e_theta) / 0.5);
        self.lane.e_theta = Radians::from_rad(e_theta);
        self.aligning = torque;
    }

    /// Active in a steady curve, with the law's `torque` reached.
    pub(crate) fn active_in_curve(torque: f64) -> Self {
        let mut rig = Self::paper();
        rig.curve(torque);
        rig.run(600);
        rig.engage = true;
        let last = rig.run(1500);
        assert_eq!(last.command.mode, Mode::Active);
        assert!((rig.applied - torque).abs() < 0.01, "{} N.m", rig.applied);
        rig
    }

    /// The vehicle turns at this rate, rad/s, and its wheel stands as the steady state of table 9's has it.
    pub(crate) fn turn(&mut self, rate: f64) {
        self.yaw_rate = Some(rate);
        self.wheel = rate * 17.0 * 2.635 * (1.0 + 0.001_752_9 * SPEED * SPEED) / SPEED;
    }

    pub(crate) fn now(&self) -> Instant {
        Instant::from_us(self.clock_start_us).after(Micros::from_us(self.t_us as u32))
    }

    /// The next frame of a sender, counted.
    pub(crate) fn frame(&mut self, sender: usize) -> Frame {
        let counter = self.counters[sender];
        self.counters[sender] = counter.wrapping_add(1);
        match sender {
            0 => self.lane.encode(counter),
            1 => {
                // A sensor that is alive shows that the wheel turned, if only by its last bits.
                let rest = self.aligning - self.applied + 0.002 * self.wheel;
                let driver = self.driver.unwrap_or(rest);
                Column {
                    driver_torque: Torque::from_nm(driver),
                    wheel_angle: Radians::from_rad(self.wheel),
                    motor_torque: Torque::from_nm((self.motor)(self.applied)),
                }
                .encode(counter)
            }
            2 => Vehicle {
                speeds: self.speeds.map(Speed::from_m_per_s),
                yaw_rate: self.yaw_rate.map(TurningRate::from_rad_per_s),
            }
            .encode(counter),
            _ => Request {
                engage: self.engage,
                authority: Ratio::from_si(self.authority),
                probe: self.probe,
            }
            .encode(counter),
        }
    }

    /// Hands a frame to the ECU.
    pub(crate) fn send(&mut self, frame: &Frame) -> Result<(), Reject> {
        let now = self.now();
        let result = self.ecu.receive(frame, now);
        if let (Ok(()), Ok(bytes)) = (result, <[u8; 8]>::try_from(frame.data())) {
            let word = u64::from_le_bytes(bytes);
            // Bits 12..29 signed, 2^-12 N.m; bit 12: layouts written a second time.
            let driver = (word << 34).cast_signed() >> 46;
            let heard = &mut self.heard;
            match frame.id() {
                0x100 if word >> 55 & 1 == 1 => {
                    heard.lane = Some((((word >> 46 & 0x1FF) + (word >> 56 & 3) * 512) * 100, self.t_us))
                }
                0x110 => heard.driver = Some((driver as f64 / 4096.0, self.t_us)),
                0x120 => heard.speeds = Some(self.t_us),
                0x130 => heard.engage = Some((word >> 12 & 1 == 1, self.t_us)),
                _ => {}
            }
        }
        result
    }

    /// Time passes, senders whose turn it is speak, the ECU steps.
    pub(crate) fn tick_after(&mut self, us: u32) -> Step {
        self.t_us += u64::from(us);
        for (sender, period) in [8, 2, 10, 10].into_iter().enumerate() {
            if self.ticks.is_multiple_of(period) {
                let frame = self.frame(sender);
                if !self.silent[sender] {
                    let result = self.send(&frame);
                    self.rejects.extend(result.err());
                }
            }
        }
        self.ticks += 1;
        self.step()
    }

    /// The ECU steps, without time or frames.
    pub(crate) fn step(&mut self) -> Step {
        let step = self.ecu.step(self.now());
        self.applied = step.command.torque.nm();
        if let Some(frame) = self.ecu.background_step() {
            let data: [u8; 8] = frame.data().try_into().unwrap();
            assert!(frame.id() == Telemetry::ID && Telemetry::PROTECTION.is_intact(&data));
            self.telemetry_counter = data[1] & 0x0F;
            self.telemetry = Telemetry::unpack(&data);
        }
        step
    }

    pub(crate) fn tick(&mut self) -> Step {
        self.tick_after(1000)
    }

    /// So many milliseconds; the last step.
    pub(crate) fn run(&mut self, ms: u32) -> Step {
        for _ in 1..ms {
            self.tick();
        }
        self.tick()
    }

    /// Ticks until `stop`, at most `ms`; how many there were.
    pub(crate) fn run_until(&mut self, ms: u32, stop: impl Fn(&Step) -> bool) -> (u32, Step) {
        for k in 1..=ms {
            let step = self.tick();
            if stop(&step) {
                return (k, step);
            }
        }
        panic!("not within {ms} ms");
    }
}
