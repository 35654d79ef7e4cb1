//! `cargo xtask faults`.

use crate::reports::faults::{report, report_of_run};
use clap::Args;
use haptic_campaign::drivers::Drivers;
use haptic_campaign::table::{self, FaultCase, Place};
use haptic_campaign::{World, campaign, document, target};
use haptic_core::controller::params::LAWS;
use haptic_log::near::did_you_mean;
use haptic_report::document::write_bytes;
use haptic_sim::worlds::WORLDS;

use host_sim::cli::results::ResultArguments;
use host_sim::cli::{BadInput, Outcome, chosen, print, progress};

#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Rows to run, by name, separated by commas; default: all that run here
    #[arg(long, value_delimiter = ',', value_name = "NAME,...")]
    rows: Vec<String>,
    /// Runs of each row: N seeds from the first on
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    seeds: u64,
    /// The first seed. The limits were chosen with seeds 1 to 500; docs/evidence.toml names those that nothing was chosen with
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = clap::value_parser!(u64).range(..=u64::MAX - 1_000_001))]
    first_seed: u64,
    /// One seed alone, to run a failure again; shows what the ECU reported
    #[arg(long, value_name = "K", conflicts_with_all = ["seeds", "first_seed"])]
    seed: Option<u64>,
    /// The world to drive in, by name (`cargo xtask availability --list`); default: the paper's, flat and linear. In any other one
    /// every rule of every cycle must hold, where the vehicle goes is judged, and what is noticed is counted. In `braking` the
    /// vehicle brakes or speeds up by up to 4 m/s2 around each fault
    #[arg(long, value_name = "NAME", conflicts_with = "target")]
    world: Option<String>,
    /// Who drives: `paper`, the drivers of the paper's tables, for its car without friction, or `population`, those of
    /// `cargo xtask availability`, who keep the lane in a real one, or `relying`, those of them who rely on the guidance; default: `paper` without --world, `population` with it
    #[arg(long, value_name = "WHO", conflicts_with = "target", value_parser = Drivers::ALL.map(Drivers::name))]
    drivers: Option<String>,
    /// The guidance law on the ECU. The table's limits of torque (2 N.m) and of reaction were chosen for the paper's
    #[arg(long, conflicts_with = "target", default_value = LAWS[0], value_parser = LAWS)]
    law: String,
    /// Run in QEMU: the image takes the ECU's place, for the rows marked Q
    #[arg(long)]
    target: bool,
    /// Print the table of faults in Markdown: what each injects, its class, the reaction and its deadline, the largest torque; run nothing
    #[arg(long, conflicts_with_all = ["rows", "world", "drivers", "law", "seeds", "first_seed", "seed", "target", "json", "out"])]
    list: bool,
    #[command(flatten)]
    results: ResultArguments,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    if arguments.list {
        print(&document::table_of_faults())?;
        return Ok(Outcome::Good);
    }
    let seeds = match arguments.seed {
        Some(seed) => seed..seed + 1,
        None => arguments.first_seed..arguments.first_seed + arguments.seeds,
    };
    let world = match &arguments.world {
        None => None,
        Some(name) => {
            let names = std::slice::from_ref(name);
            Some(chosen("--world", names, &WORLDS, |kind| kind.name)?[0])
        }
    };
    let world = World::new(world);
    let asked = |drivers: &Drivers| arguments.drivers.as_deref() == Some(drivers.name());
    let world = match Drivers::ALL.into_iter().find(asked) {
        Some(drivers) => world.driven_by(drivers),
        None => world,
    };
    let law = LAWS.iter().position(|law| *law == arguments.law);
    let world = world.guided_by(law.unwrap_or_default());
    let rows = choose(&arguments.rows, arguments.target, world.has_bar())?;
    let output = arguments.results.begin("faults")?.named("faults.json");
    let runs = rows.len() as u64 * (seeds.end - seeds.start);
    let campaign = progress::over(runs, "runs", |done| {
        if arguments.target {
            return target::run(&world, &rows, seeds, done);
        }
        Ok(campaign::run(&world, &rows, seeds, done))
    })?;
    let told = arguments.seed.into_iter().flat_map(|seed| {
        let world = &world;
        rows.iter()
            .map(move |row| report_of_run(row, world.run(row, seed)))
    });
    if let Some(place) = output.place() {
        write_bytes(&place.join("faults.md"), document::table_of_faults())?;
    }
    let holds = campaign.failures().next().is_none() && campaign.too_often().next().is_none();
    output.show(&report(&campaign, told.collect()), &campaign, holds)
}

fn choose(names: &[String], in_qemu: bool, has_bar: bool) -> Result<Vec<&'static FaultCase>, BadInput> {
    let runs = |row: &&'static FaultCase| match row.place {
        Place::Host => !in_qemu,
        Place::Both => true,
        Place::Target => false,
    };
    if names.is_empty() {
        let there = |row: &&'static FaultCase| row.left_out(has_bar).is_none();
        return Ok(table::rows().filter(runs).filter(there).collect());
    }
    let found = |name: &String| {
        let refused = |why: &str| Err(BadInput(format!("--rows: {why}")));
        match table::rows().find(|row| row.name == name) {
            None => {
                let near = did_you_mean(name, table::rows().map(|row| row.name));
                refused(&format!("there is no fault {name}{near}; --list shows them all"))
            }
            Some(row) if row.place == Place::Target => refused(&format!(
                "{name} breaks the image and not the controller: cargo test -p haptic-guidance resets::"
            )),
            Some(row) if !runs(&row) => refused(&format!("{name} is not among those that run with --target")),
            Some(row) => match row.left_out(has_bar) {
                Some(why) => refused(&format!("{name} is left out of this world: {why}")),
                None => Ok(row),
            },
        }
    };
    names.iter().map(found).collect()
}
