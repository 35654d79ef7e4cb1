//! Edges that defects made by hand went over unseen: a constant by one, a guard dropped, a word left out. Each
//! test names the defect that it is for; `cargo xtask mutants --by-hand` puts them in, one by one (`mutants.toml`), and
//! fails if none of the tests does.
//!
//! Above 500 lines because its tests answer to one list, `mutants.toml`: split, a reader could not see which defect lacks a
//! test.

use crate::rig::Rig;
use haptic_core::bus::Reject;
use haptic_core::bus::e2e::{Protection, ReceiverState};
use haptic_core::bus::messages::{Column, Guidance, Identity, Message, Telemetry};
use haptic_core::controller::config::{Config, Setup};
use haptic_core::controller::inputs::{ColumnState, Input, Inputs, Motion, Request};
use haptic_core::controller::{Controller, ControllerState};
use haptic_core::ecu::Step;
use haptic_core::ecu::injection::Region;
use haptic_core::estimator::{Reading, Sample};
use haptic_core::lane::LaneSample;
use haptic_core::quantity::{Instant, Micros, Radians, Ratio, Speed, Torque, TurningRate};
use haptic_core::safety::actuator::{Actuator, Motor};
use haptic_core::safety::envelope::LimitReason;
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;

const LANE: usize = 0;
const COLUMN: usize = 1;
const REQUEST: usize = 3;

/// `ready` counts while the vehicle is too slow: Active for one step, until the end of the request is noticed.
#[test]
fn nobody_engages_below_the_least_speed_for_even_one_step() {
    for (speed, engages) in [(4.99, false), (5.0, true)] {
        let mut rig = Rig::paper();
        rig.speeds = [speed; 2];
        rig.run(700);
        rig.engage = true;
        let engaged = (0..100).any(|_| rig.tick().command.mode == Mode::Active);
        assert_eq!(engaged, engages, "{speed} m/s");
    }
}

/// The handover starts from the torque applied, probe and all, where that is the smaller one.
#[test]
fn a_handover_from_a_falling_torque_keeps_no_wave_of_the_probe() {
    let mut rig = Rig::active_in_curve(1.6);
    rig.probe = true;
    // Its amplitude is whole, and its wave near the top, at the end of the fall.
    rig.run(600);
    for k in 1..=19 {
        rig.speeds[1] = crate::rig::SPEED + 0.1 * f64::from(k);
        rig.run(10);
    }
    let wave = |step: &Step| step.command.probe.unwrap().nm();
    let mut torque = 1.6;
    let mut last = rig.tick();
    // Three quarters of a wave, 0.3 s, before the next top.
    let mut before = 0.0;
    while torque > 1.1 || !(0.0..0.01).contains(&wave(&last)) || before < wave(&last) {
        before = wave(&last);
        // Within the reduction limit, the wave's own slope included.
        torque -= 0.0016;
        assert!(torque > 0.3, "the wave never came");
        rig.curve(torque);
        last = rig.tick();
    }
    rig.speeds[1] = crate::rig::SPEED + 2.1;
    let (mut guidance, mut top) = (0.0, 0.0);
    let handover = loop {
        let step = rig.tick();
        if step.command.mode != Mode::Active {
            break step;
        }
        (guidance, top) = (step.command.torque.nm() - wave(&step), wave(&step));
    };
    assert!(top > 0.1, "{top}");
    assert!(handover.command.faults.contains(Fault::SpeedImplausible));
    for k in 2..=2000 {
        let got = rig.tick().command.torque.nm();
        let most = guidance * (1.0 - f64::from(k) / 2000.0) + 0.001;
        assert!(k < 60 || got <= most, "{k}: {got}, at most {most}");
    }
}

/// The probe goes on where an earlier one stopped: a jump of its whole amplitude.
#[test]
fn a_probe_begins_from_zero_whenever_guidance_does() {
    let mut rig = Rig::active_in_curve(0.4);
    rig.probe = true;
    rig.run(900);
    rig.engage = false;
    rig.run_until(800, |step| step.command.mode == Mode::Standby);
    rig.run(600);
    rig.engage = true;
    rig.run_until(20, |step| step.command.mode == Mode::Active);
    for k in 2..200 {
        let probe = rig.tick().command.probe.unwrap().nm().abs();
        // 0.2 N.m times the share of the first period of 400 ms.
        let most = 0.2 * f64::from(k) / 400.0 + 0.001;
        assert!(probe <= most, "{probe} N.m after {k} ms");
    }
}

/// Ticks with a torque that grows by `slope` N.m a tick until it has reached `until` and `sender` has just spoken;
/// returns the torque applied before that.
fn grow(rig: &mut Rig, torque: &mut f64, slope: f64, until: f64, period: u64) -> f64 {
    while *torque < until || !rig.ticks.is_multiple_of(period) {
        *torque += slope;
        rig.curve(*torque);
        rig.tick();
    }
    let trusted = rig.applied;
    *torque += slope;
    rig.curve(*torque);
    rig.tick();
    trusted
}

/// Asserts that the handover under way follows the line from `trusted`, that began `ms` ago.
fn assert_line(rig: &mut Rig, trusted: f64, length: u32) {
    for k in 2..=length - 100 {
        let got = rig.tick().command.torque.nm();
        let line = trusted * (1.0 - f64::from(k) / f64::from(length));
        // Before, the reduction limit brings it down; between two remembered outputs lie 5 ms.
        assert!(k < 100 || (got - line).abs() <= 0.02, "{k}: {got}, not {line}");
    }
}

/// The silence of a sender is left out of what makes outputs suspect.
#[test]
fn a_handover_trusts_no_output_of_the_silence_whoever_is_silent() {
    for (sender, period) in [(COLUMN, 2), (2, 10), (REQUEST, 10)] {
        let mut rig = Rig::active_in_curve(0.4);
        let mut torque = 0.4;
        let trusted = grow(&mut rig, &mut torque, 0.0026, 1.0, period);
        rig.silent[sender] = true;
        let mut handed_over = false;
        for _ in 0..40 {
            torque += 0.0026;
            rig.curve(torque);
            if rig.tick().command.mode == Mode::Handover {
                handed_over = true;
                break;
            }
        }
        assert!(
            handed_over && rig.applied > trusted + 0.05,
            "{sender}: {}",
            rig.applied
        );
        // Without a column twice as fast.
        assert_line(&mut rig, trusted, if sender == COLUMN { 1000 } else { 2000 });
    }
}

/// Silence counted in steps of a millisecond: with late ones less time seems to have passed.
#[test]
fn a_silence_is_counted_in_time_and_not_in_steps() {
    let mut rig = Rig::active_in_curve(0.4);
    let mut torque = 0.4;
    let trusted = grow(&mut rig, &mut torque, 0.0034, 1.0, 2);
    rig.silent[COLUMN] = true;
    for _ in 0..20 {
        torque += 0.0034 * 2.4;
        rig.curve(torque);
        // Late, as a step may be.
        if rig.tick_after(2_400).command.mode == Mode::Handover {
            break;
        }
    }
    assert!(rig.applied > trusted + 0.05, "{}", rig.applied);
    assert_line(&mut rig, trusted, 1000);
}

/// The checks take the first speed though the second contradicts it, and find fault with honest inputs.
#[test]
fn a_speed_that_another_contradicts_is_not_used() {
    let mut rig = Rig::active_in_curve(1.5);
    for k in 1..=40 {
        rig.speeds[0] = crate::rig::SPEED + 0.9 * f64::from(k);
        rig.run(10);
    }
    for _ in 0..3000 {
        let faults = rig.tick().command.faults;
        assert!(faults.contains(Fault::SpeedImplausible));
        assert!(!faults.contains(Fault::ColumnImplausible) && !faults.contains(Fault::LaneImplausible));
    }
}

/// The sum goes on across the gap, and what was almost too much before it is too much after.
#[test]
fn what_the_column_summed_up_ends_with_its_loss() {
    let implausible = |step: &Step| step.command.faults.contains(Fault::ColumnImplausible);
    let mut rig = Rig::paper();
    rig.run(100);
    // 1.7 N.m that turn nothing, of which friction may hold 0.5: 0.54 N.m.s after 600 ms, with a memory of 1 s; the
    // margin is 0.6.
    rig.driver = Some(1.7);
    for _ in 0..600 {
        assert!(!implausible(&rig.tick()));
    }
    rig.silent[COLUMN] = true;
    rig.run(60);
    rig.silent[COLUMN] = false;
    for k in 0..600 {
        assert!(!implausible(&rig.tick()), "{k} ms after the gap");
    }
    assert!((0..400).any(|_| implausible(&rig.tick())));
}

/// Once invalid, for ever the reason.
#[test]
fn a_valid_preview_clears_the_mark_of_an_invalid_one() {
    let mut rig = Rig::active_in_curve(1.0);
    rig.lane.valid = false;
    rig.run(16);
    rig.lane.valid = true;
    rig.run(100);
    rig.silent[LANE] = true;
    let (_, step) = rig.run_until(1060, |step| step.command.mode == Mode::Handover);
    assert!(step.command.faults.contains(Fault::LaneTimeout));
    assert!(!step.command.faults.contains(Fault::LaneInvalid));
}

/// What else is wrong must be in the frame that says so.
#[test]
fn a_veto_hides_no_other_fault() {
    let mut rig = Rig::active_in_curve(1.0);
    rig.silent[LANE] = true;
    rig.run_until(1060, |step| step.command.mode == Mode::Handover);
    rig.ecu.flip_bit(Region::Monitor, 40);
    let step = rig.tick();
    assert!(!step.permitted);
    let bytes: [u8; 8] = step.guidance.data().try_into().unwrap();
    let told = Guidance::unpack(&bytes).unwrap().faults;
    for fault in [Fault::LaneTimeout, Fault::Monitor, Fault::Memory] {
        assert!(
            step.command.faults.contains(fault) && told.contains(fault),
            "{fault:?}"
        );
    }
}

/// All that a veto says, in the same step: no torque, no probe, its reason, for good.
#[test]
fn a_veto_takes_torque_and_probe_at_once() {
    let mut rig = Rig::active_in_curve(1.0);
    rig.probe = true;
    let step = rig.run(700);
    assert!(step.command.probe.is_some());
    rig.ecu.flip_bit(Region::Monitor, 40);
    let Step {
        command, guidance, ..
    } = rig.tick();
    assert_eq!((command.torque, command.probe), (Torque::ZERO, None));
    assert_eq!((command.limit, command.mode), (LimitReason::Monitor, Mode::Fault));
    assert!(command.warning);
    let bytes: [u8; 8] = guidance.data().try_into().unwrap();
    let told = Guidance::unpack(&bytes).unwrap();
    assert_eq!(
        (told.torque, told.limit, told.mode),
        (Torque::ZERO, LimitReason::Monitor, Mode::Fault)
    );
    assert!(told.warning);
    rig.telemetry = None;
    let step = rig.run(40);
    assert_eq!(
        (step.command.torque, step.command.mode),
        (Torque::ZERO, Mode::Fault)
    );
    assert_eq!(rig.telemetry.and_then(|telemetry| telemetry.probe), None);
}

/// The first of the three frames that a sender has to show is believed without its CRC.
#[test]
fn each_of_the_three_frames_of_a_new_sender_needs_its_crc() {
    let protection = Protection::new(0x11);
    for damaged in 0..3_u8 {
        let mut state = ReceiverState::NEW;
        let results = [0, 1, 2].map(|counter| {
            let mut data = [0; 8];
            protection.protect(&mut data, counter);
            if counter == damaged {
                data[5] ^= 0x10;
            }
            state.accept(&protection, &data, 3)
        });
        assert_eq!(results[usize::from(damaged)], Err(Reject::Crc));
        assert!(results.iter().all(Result::is_err), "frame {damaged}: {results:?}");
        assert!(!state.is_trusted());
    }
}

/// PATIENCE of 12 steps instead of 10.
#[test]
fn a_motor_is_astray_for_ten_steps_and_not_eleven() {
    let mut actuator = Actuator::default();
    let judged: Vec<Motor> = (0..12)
        .map(|_| {
            actuator.deliver(Torque::from_nm(0.11));
            actuator.judge(Torque::ZERO)
        })
        .collect();
    assert_eq!(judged.iter().position(|motor| *motor == Motor::Astray), Some(10));
}

/// SPEAKS_FOR of 5 steps instead of 4.
#[test]
fn a_measurement_speaks_for_four_steps_and_not_five() {
    let mut actuator = Actuator::default();
    // One every six steps: four of them count, so that the eleventh astray is the third of the third six.
    let judged: Vec<Motor> = (0..24)
        .map(|step| {
            if step % 6 == 0 {
                actuator.deliver(Torque::from_nm(0.11));
            }
            actuator.judge(Torque::ZERO)
        })
        .collect();
    assert_eq!(judged.iter().position(|motor| *motor == Motor::Astray), Some(14));
}

/// `>=` in place of `>` at the edges of the band: 0.1 N.m from nothing commanded.
#[test]
fn a_motor_at_the_edge_of_its_band_obeys() {
    for edge in [0.1, -0.1] {
        let mut actuator = Actuator::default();
        for step in 0..100 {
            actuator.deliver(Torque::from_nm(edge));
            assert_eq!(actuator.judge(Torque::ZERO), Motor::Obeys, "{edge} {step}");
        }
    }
}

/// WEAK_PATIENCE of 49 or 51 steps, or a motor that is weak in one step alone.
#[test]
fn a_motor_is_weak_from_the_fifty_first_step_on() {
    let mut actuator = Actuator::default();
    let mut judge = |delivered: f64| {
        actuator.deliver(Torque::from_nm(delivered));
        actuator.judge(Torque::from_nm(2.0))
    };
    // Until the band has closed around the command.
    (0..1000).for_each(|_| assert_eq!(judge(2.0), Motor::Obeys));
    let judged: Vec<Motor> = (0..120).map(|_| judge(1.0)).collect();
    assert!(judged[..50].iter().all(|motor| *motor == Motor::Obeys));
    assert!(judged[50..].iter().all(|motor| *motor == Motor::Weak));
}

/// The monitor's test comes with step 512*k + 1, and stands back by three steps at most from a new sample of the column and
/// from a line of the fault history.
#[test]
fn the_monitor_is_tested_in_a_step_with_little_else_to_do() {
    // Whether the column's samples come with odd steps, and the step in which a blind monitor is found.
    for (odd, from, found) in [
        (false, 1200, 1537),
        (true, 1200, 1538),
        (false, 1700, 2049),
        // 2049 has a sample, 2050 has a line, 2051 has a sample.
        (true, 1700, 2052),
    ] {
        let mut rig = Rig::paper();
        if odd {
            rig.step();
        }
        rig.run(from - u32::from(odd));
        rig.ecu.blind_monitor(|_| true);
        let (after, _) = rig.run_until(600, |step| step.command.faults.contains(Fault::SelfTest));
        // Steps are counted from zero.
        assert_eq!(from + after - 1, found, "{odd}");
    }
}

/// 2^11 in place of the largest count of eleven bits: the sign would turn.
#[test]
fn telemetry_beyond_its_fields_stays_at_their_ends() {
    let beyond = Telemetry {
        probe: Some(Torque::from_nm(0.6)),
        k_hg: Some(Reading {
            k_hg: Ratio::from_si(5.0),
            deviation: Ratio::from_si(3.0),
        }),
    };
    let frame = beyond.encode(0);
    let read = Telemetry::unpack(frame.payload().unwrap()).unwrap();
    // Of the fields of core/haptic.dbc: 2047 counts of 2^-12 N.m, 4, 2047 counts of 2^-10.
    assert_eq!(read.probe.unwrap().nm(), 2047.0 / 4096.0);
    let reading = read.k_hg.unwrap();
    assert_eq!(
        (reading.k_hg.si(), reading.deviation.si()),
        (4.0, 2047.0 / 1024.0)
    );
}

/// The largest number of a vehicle is the largest of its field.
#[test]
fn the_largest_number_of_a_vehicle_arrives_whole() {
    let sent = Identity {
        vehicle: Identity::VEHICLE_MAX,
        hardware: u32::MAX,
    };
    let frame = sent.encode(0);
    assert_eq!(Identity::unpack(frame.payload().unwrap()), Some(sent));
    assert_eq!(sent.vehicle, 0xF_FFFF);
}

/// Telemetry comes every 20 steps, and stands back from a step with a new sample of the column, by three at most.
#[test]
fn telemetry_comes_once_in_twenty_steps_and_beside_new_samples() {
    // The column: silent, every other step, in every step.
    for (every, place) in [(0, 0), (2, 1), (1, 3)] {
        let mut rig = Rig::paper();
        rig.silent[COLUMN] = every != 2;
        let came: Vec<u64> = (0..400)
            .filter(|step| {
                if every == 1 {
                    let still = Column {
                        driver_torque: Torque::ZERO,
                        wheel_angle: Radians::ZERO,
                        motor_torque: Torque::ZERO,
                    };
                    // The first frames are not trusted yet.
                    let is_heard = rig.send(&still.encode((*step & 15) as u8)).is_ok();
                    assert!(is_heard || *step < 3, "{step}");
                }
                rig.telemetry = None;
                let counter = rig.telemetry_counter;
                rig.tick();
                let came = rig.telemetry.is_some();
                assert!(!came || *step < 20 || rig.telemetry_counter == (counter + 1) % 16);
                came
            })
            .collect();
        let expected: Vec<u64> = (0..400).step_by(20).map(|turn| turn + place).collect();
        // From where the column is trusted.
        assert_eq!(came[2..], expected[2..], "{every}");
    }
}

/// The first sample is taken for one that follows a sample at phase zero: the first block begins in the middle of its
/// window, and the first reading comes early.
#[test]
fn the_first_reading_takes_six_seconds_whenever_the_probe_begins() {
    for start_us in [0, 50_000, 123_000, 200_000, 311_000, 399_000] {
        let estimator = Setup::PAPER.estimator;
        let mut state = estimator.start();
        let first = (0..4000).find(|k| {
            let at = Instant::from_us(start_us).after(Micros::from_ms(2 * k));
            let wave = (f64::from(start_us + 2000 * k) * 1e-6 * 2.5 * std::f64::consts::TAU).sin();
            let sample = Sample {
                at,
                applied: Torque::from_nm(0.2 * wave),
                driver_torque: Torque::from_nm(-0.1 * wave),
                wheel_angle: Radians::ZERO,
            };
            estimator.step(&mut state, Some(&sample));
            // Between two samples the work of the last block is done.
            estimator.step(&mut state, None);
            state.reading().is_some()
        });
        // A block of 2 s, and four more of which each begins half a block after the last; then 15 steps of work.
        let ms = 2 * first.unwrap();
        assert!((5_990..=6_040).contains(&ms), "{ms} ms, begun at {start_us} us");
    }
}

/// Where the answer is always one and the same, parameters are written at speed, or never.
#[test]
fn stands_by_both_of_its_speeds_and_only_when_they_are_known() {
    let mut rig = Rig::paper();
    rig.run(600);
    for (speeds, silent, stands) in [
        ([16.0, 16.0], false, false),
        ([0.0, 0.0], false, true),
        ([0.0, 1.0], false, false),
        ([1.0, 0.0], false, false),
        ([0.0, 0.0], true, false),
    ] {
        rig.speeds = speeds;
        rig.silent[2] = silent;
        // What jumps is refused for 0.33 s; then 16 m/s at 12 m/s2, or a hundred messages.
        rig.run(2000);
        assert_eq!(rig.ecu.stands(), stands, "{speeds:?}, silent: {silent}");
    }
}

#[test]
fn a_yaw_rate_is_there_if_it_was_measured() {
    let rate = TurningRate::from_rad_per_s(-0.1);
    let speeds = [Speed::from_m_per_s(20.0); 2];
    assert_eq!(Motion::new(speeds, Some(rate)).yaw_rate(), Some(rate));
    assert_eq!(Motion::new(speeds, None).yaw_rate(), None);
}

/// Steps that nobody asked for, and late ones, are a fault in a row only.
#[test]
fn steps_out_of_time_are_counted_in_a_row() {
    for (tolerated, us) in [(3, 400), (1, 2600)] {
        let mut rig = Rig::active_in_curve(0.4);
        for _ in 0..20 {
            for _ in 0..tolerated {
                let step = rig.tick_after(us);
                assert_eq!(step.command.mode, Mode::Active, "{us} us");
            }
            let step = rig.run(20);
            assert_eq!(step.command.mode, Mode::Active, "{us} us");
        }
        for _ in 0..tolerated {
            rig.tick_after(us);
        }
        let step = rig.tick_after(us);
        assert!(step.command.faults.contains(Fault::Deadline), "{us} us");
    }
}

/// A picture that is up to 10 ms old when it arrives goes on at its own rates; an older one is corrected by how the vehicle has
/// turned since. On a straight the yaw rate steps to 0.05 rad/s: of (9) that is 0.25*(0.05*0.3*16.7*0.05 + 1*0.05) = 0.0156 N.m,
/// and 0.0005 N.m more in each millisecond.
#[test]
fn a_picture_is_late_beyond_10_ms() {
    const SPEED: f64 = 50.0 / 3.0;
    for sign in [1.0, -1.0] {
        for (age_us, is_late) in [(9_999, false), (10_000, false), (10_001, true), (20_000, true)] {
            let controller = Controller::new(Config::PAPER);
            let start = Instant::from_us(1_000_000);
            let mut state = ControllerState::engaged(start);
            let (mut applied, mut motion, mut lane) = (Torque::ZERO, None, None);
            for ms in 1..=198_u32 {
                let now = start.after(Micros::from_ms(ms));
                let [moves, shows] = [ms % 10 == 0 || ms == 1, ms < 190 && (ms % 10 == 5 || ms == 1)];
                // The step comes with a message, 5 ms after the last picture.
                let rate = if ms >= 190 { 0.05 * sign } else { 0.0 };
                if moves {
                    let rate = TurningRate::from_rad_per_s(rate);
                    motion = Some(Motion::new([Speed::from_m_per_s(SPEED); 2], Some(rate)));
                }
                if shows {
                    lane = Some(LaneSample {
                        at: now.before(Micros::from_us(age_us)),
                        ..LaneSample::default()
                    });
                }
                // A hand is never still to the bit.
                let column = ColumnState {
                    driver_torque: Torque::from_nm(1e-3 * f64::from(ms % 7)),
                    wheel_angle: Radians::ZERO,
                };
                let inputs = Inputs {
                    lane: lane.map_or(Input::Lost, if shows { Input::New } else { Input::Held }),
                    column: Input::New(column),
                    motion: motion.map_or(Input::Lost, if moves { Input::New } else { Input::Held }),
                    request: Input::New(Request {
                        engage: true,
                        authority: Ratio::ONE,
                        probe: false,
                    }),
                    faults: FaultSet::NONE,
                };
                let command = controller.step(&mut state, now, applied, &inputs);
                applied = command.torque;
            }
            let torque = sign * applied.nm();
            let expected = if is_late { -0.0156 - 8.0 * 0.0005 } else { 0.0 };
            assert!((torque - expected).abs() < 0.002, "{age_us}: {torque}");
        }
    }
}
