//! The probe from the bus: when there is one, what it looks like, what a handover and the monitor make of it,
//! and what the ECU reads from it of a driver who obeys equation (8) to the letter.

use std::f64::consts::TAU;

use crate::rig::Rig;
use haptic_core::bus::Frame;
use haptic_core::bus::messages::{Guidance, Message, Request, ResetCause, Telemetry};
use haptic_core::controller::config::Setup;
use haptic_core::controller::params::Params;
use haptic_core::estimator::Sample;
use haptic_core::quantity::{Radians, Ratio, Torque};
use haptic_core::safety::envelope::LimitReason;
use haptic_core::safety::faults::FaultSet;
use haptic_core::safety::modes::Mode;
use haptic_core::safety::monitor::{Evidence, Frames, Monitor, MonitorState, New};

/// Half an LSB of the torque on the bus, and the arithmetic of the core.
const ROUNDING: f64 = 0.5 / 4096.0 + 1e-5;
/// The default probe: 0.2 N.m, 2.5 Hz, 400 ms.
const PERIOD_MS: u32 = 400;

fn bytes(frame: &Frame) -> [u8; 8] {
    frame.data().try_into().unwrap()
}

fn probing(torque: f64) -> Rig {
    let mut rig = Rig::active_in_curve(torque);
    rig.probe = true;
    // Until the host's next frame: one every 10 ms.
    rig.run_until(10, |step| step.command.probe.is_some());
    rig
}

#[test]
fn rides_on_the_law_as_a_sine_that_grows_over_a_period() {
    let law = 0.4;
    let mut rig = Rig::active_in_curve(law);
    let steady = rig.applied;
    rig.probe = true;
    let (first, _) = rig.run_until(10, |step| step.command.probe.is_some());
    assert!(first <= 10);
    for k in 2..4_000 {
        let step = rig.tick();
        let turns = 2.5e-3 * f64::from(k);
        let expected = 0.2 * turns.min(1.0) * (TAU * turns).sin();
        // The phase runs 4e-5 slow: 1.3e-3 rad in 2 s at the steepest slope of 0.2 N.m per rad.
        let tolerance = ROUNDING + 0.2 * 4e-5 * TAU * turns;
        assert!(
            (rig.applied - steady - expected).abs() < 2.0 * tolerance,
            "{k} ms: {}",
            rig.applied
        );
        assert!(
            (step.command.probe.unwrap().nm() - expected).abs() < tolerance,
            "{k} ms"
        );
        assert_eq!(step.command.limit, LimitReason::None);
        assert!(step.permitted);
    }
}

#[test]
fn ends_within_a_period_when_it_is_no_longer_wanted() {
    let mut rig = probing(0.4);
    rig.run(1_234);
    rig.probe = false;
    let (ms, _) = rig.run_until(PERIOD_MS + 20, |step| step.command.probe.is_none());
    assert!(ms > PERIOD_MS - 10, "{ms}");
    assert!((rig.applied - 0.4).abs() < 0.01);
    rig.run(20);
    assert_eq!(rig.telemetry.unwrap().probe, None);
}

#[test]
fn is_refused_outside_active() {
    let mut rig = Rig::paper();
    rig.probe = true;
    for _ in 0..1_000 {
        let step = rig.tick();
        assert_eq!((step.command.probe, rig.applied), (None, 0.0));
        assert_ne!(step.command.mode, Mode::Active);
    }
    assert_eq!(
        rig.telemetry,
        Some(Telemetry {
            probe: None,
            k_hg: None
        })
    );
    // A fade is a straight line at 4 N.m/s, whatever the probe was doing.
    for ms in (500..900).step_by(37) {
        let mut rig = probing(0.4);
        rig.run(ms);
        rig.engage = false;
        let (_, first) = rig.run_until(10, |step| step.command.mode == Mode::Fade);
        assert_eq!(first.command.probe, None);
        let start = rig.applied;
        for k in 1..40 {
            let step = rig.tick();
            assert_eq!(step.command.probe, None);
            assert!(
                (rig.applied - (start - 4e-3 * f64::from(k))).abs() < ROUNDING * 2.0,
                "{ms}: {k}"
            );
        }
    }
}

/// The handover follows the line that it would follow without a probe, or the lower one from the torque that the
/// probe left: half a wave of it neither stands in the wheel for 2 s nor makes the torque grow.
#[test]
fn a_handover_keeps_no_wave_of_it() {
    for ms in (500..900).step_by(23) {
        let mut rig = probing(0.4);
        rig.run(ms);
        rig.silent[3] = true;
        rig.run_until(60, |step| step.command.mode == Mode::Handover);
        let mut last = rig.applied;
        let applied = last;
        for k in 1..2_000 {
            rig.tick();
            // The step that saw the silence was the line's first millisecond.
            let expected = applied.min(0.4) * (1.0 - f64::from(k + 1) / 2_000.0);
            assert!(rig.applied <= last + 1e-9, "{ms}: grows at {k}");
            last = rig.applied;
            // 8 N.m/s bring the crest of a wave down in 25 ms; 0.01 for the steady curve's own rounding.
            if k > 25 {
                assert!(
                    (rig.applied - expected).abs() < 0.01,
                    "{ms}: {k} ms, {} {expected}",
                    rig.applied
                );
            }
        }
    }
}

#[test]
fn the_monitor_widens_its_band_only_while_it_is_asked_for() {
    let monitor = Monitor::new(&Params {
        probe_amplitude_nm: 0.2,
        ..Params::PAPER
    });
    // 0.45 N.m where the lane asks for none: 0.15 beyond the band of 0.3, within that of 0.5.
    let guidance = Guidance {
        torque: Torque::from_nm(0.45),
        limit: LimitReason::None,
        mode: Mode::Active,
        warning: false,
        faults: FaultSet::NONE,
        reset: ResetCause::PowerOn,
    }
    .encode(0);
    let guidance = bytes(&guidance);
    let request = |probe| {
        let request = Request {
            engage: true,
            authority: Ratio::ONE,
            probe,
        };
        bytes(&request.encode(0))
    };
    let lane = haptic_core::bus::messages::LanePreview {
        valid: true,
        ..Default::default()
    };
    let lane = bytes(&lane.encode(0));
    // Asked for until `until` ms; the millisecond in which the permission ends.
    let ends = |until: u32| {
        let mut state = MonitorState::NEW;
        // Up to 0.45 N.m at 4 N.m/s is the envelope's business: here the torque is there from the start.
        let elapsed_us = 1_000;
        (0..5_000).find(|ms| {
            let request = request(*ms < until);
            let frames = with_lane(lane, request, ms.is_multiple_of(10));
            let evidence = Evidence {
                frames: &frames,
                guidance: &guidance,
                elapsed_us,
            };
            let state_before = state;
            let permitted = monitor.step(&mut state, &evidence);
            // The first step grows too fast for the monitor; it is not what this is about.
            if *ms == 0 && !permitted {
                state = grown(&monitor, state_before, &request);
                return false;
            }
            !permitted
        })
    };
    // 20 ms outside the band are tolerated.
    assert!(ends(0).is_some_and(|ms| (20..=30).contains(&ms)), "{:?}", ends(0));
    let ended = ends(2_000).unwrap();
    assert!((3_065..=3_105).contains(&ended), "{ended}");
}

fn with_lane(lane: [u8; 8], request: [u8; 8], is_request_new: bool) -> Frames {
    Frames {
        lane,
        request,
        new: New {
            lane: true,
            column: false,
            request: is_request_new,
        },
        ..Frames::NONE
    }
}

/// Brings a monitor up to 0.45 N.m at its own pace on a lane error of 1 m, which asks for 0.5 N.m, with the probe asked
/// for if `request` does.
fn grown(monitor: &Monitor, mut state: MonitorState, request: &[u8; 8]) -> MonitorState {
    let lane = haptic_core::bus::messages::LanePreview {
        valid: true,
        e_y: haptic_core::quantity::Metres::from_m(1.0),
        ..Default::default()
    };
    let lane = bytes(&lane.encode(0));
    for mnm in (0..=450).step_by(4) {
        let guidance = Guidance {
            torque: Torque::from_nm(f64::from(mnm) * 1e-3),
            limit: LimitReason::None,
            mode: Mode::Active,
            warning: false,
            faults: FaultSet::NONE,
            reset: ResetCause::PowerOn,
        };
        let guidance = bytes(&guidance.encode(0));
        let frames = with_lane(lane, *request, true);
        let evidence = Evidence {
            frames: &frames,
            guidance: &guidance,
            elapsed_us: 1_000,
        };
        assert!(monitor.step(&mut state, &evidence));
    }
    state
}

thread_local! {
    /// Whether the driver of [`drive`] has a slow torque of the hands' own.
    static STEERS: std::cell::Cell<bool> = const { std::cell::Cell::new(false) };
}

/// A driver's arm after equation (8) with a fixed wheel and no target, in f64:
/// `t_nms*dT_d/dt = -T_d - K_hg*T_h`, exact over each millisecond of constant T_h.
fn drive(rig: &mut Rig, k_hg: f64, arm: &mut f64, ms: u32) {
    let decay = (-1e-3_f64 / 0.1).exp();
    for k in 0..ms {
        *arm = *arm * decay - k_hg * rig.applied * (1.0 - decay);
        let own = if STEERS.get() {
            0.02 * (std::f64::consts::TAU * 0.25e-3 * f64::from(k)).sin()
        } else {
            0.0
        };
        rig.driver = Some(*arm + own);
        rig.tick();
    }
}

fn reading(rig: &Rig) -> Option<(f64, f64)> {
    let reading = rig.telemetry?.k_hg?;
    Some((reading.k_hg.si(), reading.deviation.si()))
}

/// Whether an estimate is as near to the truth as it can be. T_h is held for a millisecond, so what is sampled is half of one late:
/// that looks like an arm of 0.1 s that is quicker by so much, and by hand makes of K_hg at most w*0.5 ms*w*0.1 s of it less.
fn is_exact(estimate: f64, k_hg: f64, frequency_hz: f64) -> bool {
    let w = std::f64::consts::TAU * frequency_hz;
    (-0.005 - k_hg * w * 0.5e-3 * w * 0.1..0.005).contains(&(estimate - k_hg))
}

#[test]
fn an_exact_driver_is_read_exactly() {
    for k_hg in [0.02, 0.3, 1.0] {
        let (mut rig, mut arm) = (probing(0.0), 0.0);
        // Hands that rest on the wheel are never quite still: 0.02 N.m at 0.25 Hz, where no probe is.
        STEERS.set(true);
        drive(&mut rig, k_hg, &mut arm, 5_800);
        assert_eq!(reading(&rig), None, "not before five blocks: 6 s");
        drive(&mut rig, k_hg, &mut arm, 4_200);
        let (estimate, early) = reading(&rig).unwrap();
        assert!(is_exact(estimate, k_hg, 2.5), "{k_hg}: {estimate}");
        // An arm that gives way like that and does nothing else is no hand on the wheel: after 30 s the guidance would end.
        drive(&mut rig, k_hg, &mut arm, if k_hg < 0.5 { 8_000 } else { 50_000 });
        let (estimate, late) = reading(&rig).unwrap();
        assert!(is_exact(estimate, k_hg, 2.5), "{k_hg}: {estimate}");
        // No noise: from what the prior allows to the floor of 0.02, and what it leaves of the arm. One slower by 0.03 s than
        // 0.1 s, x = 1.571, makes of K_hg 0.03 w (x + j)/(1 + x^2) = 0.2135 + 0.1359 j more.
        let deviation = |noise: f64| {
            let left = noise.powi(2) / (noise.powi(2) + (0.1359 * k_hg).powi(2));
            (noise.powi(2) + left * (0.2135 * k_hg).powi(2)).sqrt()
        };
        let floor = if k_hg < 0.5 { 0.1 } else { 0.03 };
        let within = deviation(0.019)..deviation(floor);
        assert!(early > late && within.contains(&late), "{early} {late}");
        STEERS.set(false);
    }
}

/// Full reliance without a hand's own torque cannot be told from no hands: there is no reading, and one again as soon as
/// hands are back.
#[test]
fn hands_off_have_no_reading() {
    let (mut rig, mut arm) = (probing(0.0), 0.0);
    drive(&mut rig, 0.5, &mut arm, 20_000);
    assert!(reading(&rig).is_some());
    drive(&mut rig, 0.0, &mut arm, 4_500);
    assert_eq!(reading(&rig), None);
    drive(&mut rig, 0.5, &mut arm, 10_000);
    let (estimate, _) = reading(&rig).unwrap();
    assert!((estimate - 0.5).abs() < 0.05, "{estimate}");
}

#[test]
fn a_change_is_seen_and_the_memory_before_it_dropped() {
    let (mut rig, mut arm) = (probing(0.0), 0.0);
    drive(&mut rig, 0.9, &mut arm, 60_000);
    drive(&mut rig, 0.1, &mut arm, 10_000);
    let (estimate, _) = reading(&rig).unwrap();
    // The average over 40 s would still say 0.6.
    assert!((estimate - 0.1).abs() < 0.02, "{estimate}");
}

#[test]
fn nothing_is_kept_from_probe_to_probe() {
    let (mut rig, mut arm) = (probing(0.0), 0.0);
    drive(&mut rig, 0.9, &mut arm, 20_000);
    assert!(reading(&rig).is_some());
    rig.probe = false;
    drive(&mut rig, 0.9, &mut arm, 500);
    assert_eq!(reading(&rig), None);
    rig.probe = true;
    drive(&mut rig, 0.2, &mut arm, 5_500);
    assert_eq!(reading(&rig), None);
    drive(&mut rig, 0.2, &mut arm, 2_500);
    let (estimate, _) = reading(&rig).unwrap();
    assert!((estimate - 0.2).abs() < 0.005, "{estimate}");
}

/// An amplitude of zero is allowed, and there is nothing to read then, whatever the driver does.
#[test]
fn a_probe_of_zero_has_no_reading() {
    let setup = Setup::new(&Params {
        probe_amplitude_nm: 0.0,
        ..Params::PAPER
    })
    .unwrap();
    let mut rig = Rig::new(Some(&setup), Default::default());
    rig.run(600);
    (rig.engage, rig.probe) = (true, true);
    STEERS.set(true);
    drive(&mut rig, 0.6, &mut 0.0, 15_000);
    STEERS.set(false);
    assert_eq!(rig.tick().command.mode, Mode::Active);
    assert_eq!(reading(&rig), None);
}

#[test]
fn other_probes_are_read_as_well() {
    for (amplitude, frequency) in [(0.3, 1.8), (0.1, 5.0), (0.2, 2.75)] {
        let setup = Setup::new(&Params {
            probe_amplitude_nm: amplitude,
            probe_frequency_hz: frequency,
            ..Params::PAPER
        })
        .unwrap();
        let mut rig = Rig::new(Some(&setup), Default::default());
        rig.run(600);
        (rig.engage, rig.probe) = (true, true);
        let mut arm = 0.0;
        drive(&mut rig, 0.6, &mut arm, 15_000);
        let (estimate, _) = reading(&rig).unwrap();
        assert!(
            is_exact(estimate, 0.6, frequency),
            "{amplitude} N.m, {frequency} Hz: {estimate}"
        );
    }
}

/// What the ECU tells of K_hg is what the estimator makes of the torque that was applied until each sample of the column: one of
/// a millisecond later is 0.016 rad of the probe's phase, 0.01 of K_hg.
#[test]
fn the_estimator_is_told_what_was_applied_until_the_sample() {
    let mut rig = Rig::active_in_curve(0.4);
    rig.probe = true;
    let estimator = Setup::PAPER.estimator;
    let mut state = estimator.start();
    let (mut has_begun, mut driver) = (false, 0.0);
    for _ in 0..12_000 {
        let applied = rig.applied;
        // An arm with the lag that is assumed: of one that yields at once the estimator takes a later sample for another lag.
        driver += (-0.5 * (applied - 0.4) - driver) / 100.0;
        rig.driver = Some(driver);
        let is_new = rig.ticks.is_multiple_of(2);
        let step = rig.tick();
        if step.command.probe.is_none() || !has_begun {
            has_begun = step.command.probe.is_some();
            continue;
        }
        let sample = Sample {
            at: rig.now(),
            applied: Torque::from_nm(applied),
            driver_torque: Torque::from_nm((driver * 4096.0).round() / 4096.0),
            wheel_angle: Radians::from_rad(rig.wheel),
        };
        estimator.step(&mut state, is_new.then_some(&sample));
    }
    let told = rig.telemetry.unwrap().k_hg.unwrap().k_hg.si();
    let made = state.reading().unwrap().k_hg.si();
    println!("{told} told, {made} made");
    assert!((told - made).abs() < 0.003, "{told}, not {made}");
}
