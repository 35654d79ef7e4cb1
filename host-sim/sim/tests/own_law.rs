//! Laws of one's own behind the shipping ECU: the paper's, laws that lie, every law by name; and the documents' page of them.

use haptic_core::controller::params::DRIVER_ACTIVITY;
use haptic_core::safety::modes::Mode;
use haptic_sim::drivers::{DRIVERS, HABITS};
use haptic_sim::guidance::{Guidance, OverBus, OwnLaw};
use haptic_sim::kind::{Kind, Make};
use haptic_sim::laws::{Gains, LAWS, Law, LawView};
use haptic_sim::models::STEP_S;
use haptic_sim::parts::{Driver, DriverView, PaperVehicle};
use haptic_sim::scenario::GuidanceParameters;
use haptic_sim::{Action, Scenario, Simulation};

fn law_of(kind: &Kind<dyn Law>, scenario: &Scenario) -> Box<dyn Law> {
    match kind.make {
        Make::Part(make) => make(scenario, &kind.defaults()).unwrap(),
        Make::Given(make) => make(scenario, &kind.defaults()).unwrap(),
        Make::Around(make) => make(scenario, &kind.defaults(), Box::new(Gains::PAPER)),
    }
}

#[test]
fn the_documents_have_the_equation_of_every_law_and_driver() {
    let page = include_str!("../../../docs/reference/laws-and-drivers.md");
    // Without guidance there is none; FDCA's is one of those with a word behind its name.
    let laws = LAWS.iter().map(|kind| kind.name).filter(|name| *name != "none");
    let drivers = DRIVERS.iter().chain(&HABITS).map(|kind| kind.name);
    for name in laws.chain(drivers) {
        let told = page
            .lines()
            .any(|line| line.starts_with("- `") && line.contains(&format!("`{name}`")));
        let told = told || page.contains(&format!("; `{name}`: `K_1"));
        assert!(told, "docs/reference/laws-and-drivers.md has no entry for {name}");
    }
}

/// The seam itself: (9) in f64 in the place of (9) in fixed point steers as that does.
#[test]
fn the_paper_s_law_as_a_law_of_one_s_own_is_the_shipping_ecu() {
    let scenario = Scenario::default();
    let own = Simulation::with(&scenario, OwnLaw::new(&scenario, Gains::PAPER)).run();
    let shipping = Simulation::with(&scenario, OverBus::new(scenario.setup())).run();
    assert_eq!(own.trace.samples.len(), shipping.trace.samples.len());
    for (own, shipping) in own.trace.samples.iter().zip(&shipping.trace.samples) {
        let apart_nm = own.guidance_torque_nm - shipping.guidance_torque_nm;
        assert!(apart_nm.abs() < 3e-3, "{apart_nm} N.m at {} s", own.time_s);
        assert!((own.lateral_error_m - shipping.lateral_error_m).abs() < 1e-3);
    }
}

/// A law that asks for what no law should.
#[derive(Clone)]
struct Hostile(Ask);

type Ask = fn(u32) -> f64;

impl Law for Hostile {
    fn ask(&mut self, view: &LawView) -> f64 {
        self.0(view.step)
    }
}

/// The envelope's limits as `controller.md` has them, and a step of the bus beside each: 5 N.m, 4 N.m/s up, 1.2 N.m in 250 ms, and 8
/// N.m/s down where the driver does not oppose.
#[test]
fn the_envelope_holds_whatever_a_law_asks_for() {
    // Whether it is to be silent.
    let laws: [(Ask, bool); 7] = [
        (|_| f64::NAN, true),
        (|_| f64::INFINITY, false),
        (|_| f64::NEG_INFINITY, false),
        (|_| 1000.0, false),
        (|step| if step % 2 == 0 { 1000.0 } else { -1000.0 }, false),
        (|step| if step % 2 == 0 { f64::NAN } else { 5.0 }, false),
        (
            |step| {
                if step % 200 < 100 {
                    f64::INFINITY
                } else {
                    f64::NEG_INFINITY
                }
            },
            false,
        ),
    ];
    for (number, (ask, is_silent)) in laws.into_iter().enumerate() {
        let scenario = Scenario::default();
        let mut simulation = Simulation::with(&scenario, OwnLaw::new(&scenario, Hostile(ask)));
        let mut torques = vec![0.0_f64];
        let lsb_nm = 1.0 / 4096.0;
        while torques.len() < 20_000 {
            let Some(outcome) = simulation.step(&Action::default()) else {
                break;
            };
            let (now, last) = (outcome.applied_torque_nm, torques[torques.len() - 1]);
            let driver = outcome.observation.driver_torque_nm;
            assert!(now.abs() <= 5.0 + lsb_nm, "{number}");
            let kept = if now * last < 0.0 { 0.0 } else { last.abs() };
            assert!(
                now.abs() - kept <= 4.0 * STEP_S + lsb_nm,
                "{number}: grows to {now} from {last}"
            );
            let opposes = driver * last < 0.0 && driver.abs() > 0.79;
            let mode = outcome.status.unwrap().mode;
            assert!(
                opposes || mode != Mode::Active || last.abs() - now.abs() <= 8.0 * STEP_S + 2.0 * lsb_nm,
                "{number}: {last} {now}"
            );
            let before = torques[torques.len().saturating_sub(250)];
            let before = if now * before < 0.0 { 0.0 } else { before.abs() };
            assert!(now.abs() - before <= 1.2 + lsb_nm, "{number}");
            assert!(!is_silent || now == 0.0);
            torques.push(now);
        }
    }
}

/// Nothing of an honest law ends the guidance on the paper's course.
#[test]
fn every_law_drives_the_paper_s_course() {
    for kind in &LAWS {
        let scenario = Scenario::default();
        let guidance = OwnLaw::new(&scenario, law_of(kind, &scenario));
        assert!(guidance.looks_at_road(0));
        let run = Simulation::with(&scenario, guidance).run();
        assert!(!run.diverged(), "{}", kind.name);
        assert!(
            run.trace.samples.iter().all(|s| s.unguided_cause == 0.0),
            "{}",
            kind.name
        );
        let largest_m = run
            .trace
            .samples
            .iter()
            .map(|s| s.lateral_error_m.abs())
            .fold(0.0, f64::max);
        assert!(largest_m < 1.0, "{}: {largest_m}", kind.name);
    }
}

/// Holds the wheel still, and from 5 s on pushes it with 50 N.m to one side for a second.
#[derive(Clone)]
struct Pushes(f64);

impl Driver for Pushes {
    fn look_ahead_s(&self) -> [f64; 2] {
        [0.3, 1.0]
    }

    fn step(&mut self, view: &DriverView) -> f64 {
        if (5000..6000).contains(&view.step) {
            return self.0;
        }
        5.5 * (0.2 * view.lane.e_y_m + 5.0 * view.lane.e_theta_rad - view.wheel_angle_rad)
            - 0.3 * view.wheel_rate_rad_per_s
    }
}

/// 3 N.m for each beyond 0.8 N.m of opposition leave nothing of 5 N.m from 2.47 N.m on; the torque falls there by 8 N.m/s at least.
#[test]
fn a_driver_who_pushes_50_nm_has_no_guidance_against_him() {
    for law in [0.0, DRIVER_ACTIVITY] {
        for push_nm in [50.0, -50.0] {
            let mut guidance = GuidanceParameters::default();
            guidance.controller.law = law;
            let scenario = Scenario::builder().guidance(guidance).build().unwrap();
            let vehicle = PaperVehicle::new(&scenario);
            let ecu = OverBus::new(scenario.setup());
            let mut simulation = Simulation::of_parts(&scenario, Pushes(push_nm), vehicle, ecu);
            let (mut last_nm, mut step) = (0.0_f64, 0);
            while let Some(outcome) = simulation.step(&Action::default()) {
                let now_nm = outcome.applied_torque_nm;
                assert!(
                    now_nm.abs() <= 5.0 + 1.0 / 4096.0,
                    "law {law}, {step} ms: {now_nm} N.m"
                );
                let pushed = (5010..6000).contains(&step);
                let against = now_nm * push_nm < 0.0;
                assert!(
                    !(pushed && against) || now_nm.abs() <= (last_nm.abs() - 0.007).max(0.01),
                    "law {law}, {step} ms: {now_nm} N.m after {last_nm}"
                );
                last_nm = now_nm;
                step += 1;
            }
            assert!(step > 5100, "{step}");
        }
    }
}
