//! The boards: what each is to the tools, that every one builds and keeps its torque path clean, what its image
//! costs, and how it gets onto a real one.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use clap::builder::NonEmptyStringValueParser;
use clap::{Args, ValueEnum};
use serde_json::Value;

use crate::built::Built;
use crate::code::{CONTROLLER, Code, PRODUCT};
use crate::golden::{self, Figure, figure};
use crate::image::{self, Image, M4F};
use crate::tool::{self, Usage, cargo, run};
use crate::{longest, seal, size};

/// Length of the guard below the stack (`firmware/src/stack.rs`): a larger frame could step over it.
const GUARD: u64 = 8192;
/// The stack's budget (`firmware/src/stack.x`).
const STACK: u64 = 16_384;

/// The clock of an STM32G4, and what an instruction takes there at most in the mean (docs/porting.md).
const CLOCK_MHZ: u64 = 170;
const CYCLES_PER_INSTRUCTION: u64 = 2;

/// A board, by the feature that chooses it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Board {
    /// QEMU, Cortex-M4F.
    Mps2An386,
    /// QEMU, Cortex-M7.
    Mps2An500,
    /// ST NUCLEO-G474RE, the column's sensors on the bus.
    NucleoG474re,
    /// ST NUCLEO-G474RE, the column's sensors wired to it.
    NucleoG474reSensors,
    /// Microchip SAM E54 Xplained Pro.
    SamE54Xpro,
}

impl Board {
    /// The feature, which is also QEMU's name of its machines.
    pub(crate) const fn feature(self) -> &'static str {
        match self {
            Self::Mps2An386 => "mps2-an386",
            Self::Mps2An500 => "mps2-an500",
            Self::NucleoG474re => "nucleo-g474re",
            Self::NucleoG474reSensors => "nucleo-g474re-sensors",
            Self::SamE54Xpro => "sam-e54-xpro",
        }
    }

    /// probe-rs's name of the chip; None where QEMU is the board.
    pub(crate) const fn chip(self) -> Option<&'static str> {
        match self {
            Self::Mps2An386 | Self::Mps2An500 => None,
            Self::NucleoG474re | Self::NucleoG474reSensors => Some("STM32G474RETx"),
            Self::SamE54Xpro => Some("ATSAME54P20A"),
        }
    }

    /// Where the page of keys begins; None where QEMU is the board. A test compares it with the memory map.
    pub(crate) const fn keys_at(self) -> Option<u32> {
        match self {
            Self::Mps2An386 | Self::Mps2An500 => None,
            Self::NucleoG474re | Self::NucleoG474reSensors => Some(0x0807_D800),
            Self::SamE54Xpro => Some(0x000F_6000),
        }
    }

    /// Builds an image. QEMU's is for the bench (`firmware/Cargo.toml`); a board's product is sealed.
    pub(crate) fn build(self, image: Image) -> Result<PathBuf> {
        let elf = image::elf_of(&mut image::build_command(image.bin(), M4F, &self.features()))?;
        self.seal(image, &elf)?;
        Ok(elf)
    }

    /// Builds what is handed on into `elf`; the linker's map.
    pub(crate) fn build_to_ship(self, image: Image, elf: &Path) -> Result<String> {
        let (built, map) = image::with_map(image.bin(), &self.features())?;
        std::fs::copy(&built, elf).with_context(|| built.display().to_string())?;
        self.seal(image, elf)?;
        Ok(map)
    }

    fn features(self) -> String {
        if self.chip().is_none() {
            format!("{},bench", self.feature())
        } else {
            self.feature().to_owned()
        }
    }

    fn seal(self, image: Image, elf: &Path) -> Result<()> {
        if self.chip().is_some() && image == Image::SteeringEcu {
            seal::seal(elf)?;
        }
        Ok(())
    }
}

/// What goes onto which board.
#[derive(Args)]
pub(crate) struct Options {
    /// The board.
    pub(crate) board: Board,
    /// The image.
    #[arg(long, default_value = "steering-ecu")]
    pub(crate) image: Image,
}

/// Which board is compared, and how it is reached.
#[derive(Args)]
pub(crate) struct Hil {
    /// The board.
    board: Board,
    /// The way to a real board's bus: a CAN interface (can0), the serial port of an SLCAN adapter
    /// (/dev/ttyUSB0; not that of the debug probe), or tcp:HOST:PORT.
    #[arg(long, value_name = "IFACE", value_parser = NonEmptyStringValueParser::new())]
    can: Option<String>,
    /// The lockstep image is on the board already.
    #[arg(long)]
    no_flash: bool,
}

/// Which boards.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scope {
    /// QEMU's machines. The libraries of the other boards' processors take longer to compile than all of this project.
    Qemu,
    All,
}

/// The images with these features without a warning.
pub(crate) fn lint(features: &str) -> Result<()> {
    let package = "--profile firmware -p haptic-firmware --bins --lib";
    run(cargo()
        .arg("clippy")
        .args(package.split(' '))
        .args(["--target", M4F, "--features", features])
        .args(["--", "-D", "warnings"]))
}

/// Boards without a warning; the torque path of the images without panic and float, and their figures as the golden file
/// has them.
pub(crate) fn check(scope: Scope, built: Built, bless: bool) -> Result<()> {
    tool::ensure(&[("qemu-system-arm", "qemu-system-arm")])?;
    let mut figures = Vec::new();
    let wanted = |board: &&Board| scope == Scope::All || board.chip().is_none();
    for board in Board::value_variants().iter().filter(wanted) {
        let name = board.feature();
        lint(name).with_context(|| name.to_owned())?;
        for (image, roots) in [(Image::Lockstep, CONTROLLER), (Image::SteeringEcu, PRODUCT)] {
            let built =
                of_image(&board.build(image)?, roots).with_context(|| format!("{name}, {}", image.bin()))?;
            if image == Image::Lockstep {
                figures.push(longest(&board.build(image)?)?.on_board(name));
            } else {
                figures.extend(built.into_iter().map(|figure| figure.on_board(name)));
            }
        }
        if board.chip().is_none() {
            figures.extend(
                in_qemu(*board, built)?
                    .into_iter()
                    .map(|figure| figure.on_board(name)),
            );
        }
    }
    for figure in figures.iter().filter(|figure| figure.unit == "instructions") {
        println!(
            "{}: {} instructions, {:.1} % of a tick at {} MHz and {CYCLES_PER_INSTRUCTION} cycles each",
            figure.name,
            figure.value,
            100.0 * (figure.value * CYCLES_PER_INSTRUCTION) as f64 / (CLOCK_MHZ * 1000) as f64,
            CLOCK_MHZ,
        );
    }
    golden::check(&figures, bless)
}

/// Beside what was counted: what no state can exceed.
fn longest(elf: &Path) -> Result<Figure> {
    let longest = longest::read(elf)?;
    println!(
        "{}: at most {} instructions for a frame and {} for a step, by its machine code",
        elf.display(),
        longest.receive,
        longest.step
    );
    for (what, rounds, instructions) in &longest.loops {
        println!("  a loop, at most {rounds} times {instructions}: {what}");
    }
    Ok(figure("longest tick, bound", "instructions", longest.tick(), 1))
}

impl Figure {
    fn on_board(mut self, board: &str) -> Self {
        self.name = format!("{board} {}", self.name);
        self
    }
}

/// What an image takes, and that its torque path is clean.
fn of_image(elf: &Path, roots: [&str; 2]) -> Result<Vec<Figure>> {
    let size = size::read(elf)?;
    let code = Code::from_image(elf)?;
    let frame = code.largest_frame();
    ensure!(
        frame <= GUARD,
        "a frame of {frame} B could step over the guard of {GUARD} B below the stack"
    );
    let path = code.torque_path(roots)?;
    println!(
        "{}: no panic and no float in the {} functions of the torque path",
        elf.display(),
        path.functions
    );
    let called = code.stack_of("main")?;
    ensure!(called <= STACK, "calls take {called} B of stack, of {STACK} B");
    // Paths of the machine's crate cache are in panic messages, so sizes differ a little.
    Ok(vec![
        figure("flash", "B", size.flash, 1),
        figure("RAM without stack", "B", size.ram, 1),
        figure("largest frame", "B", frame, 1),
        figure("stack of the step, bound", "B", path.stack, 1),
        figure("stack of the image, calls", "B", called, 1),
    ])
}

/// Drives in which something happens: guidance that fails or is handed over, brakes, every field of a scenario, a torsion bar. Their
/// steps take more.
const EVENTFUL: [&str; 4] = [
    "examples/relying-driver.toml",
    "examples/every-field.toml",
    "examples/braking-into-a-curve.toml",
    "examples/torsion-bar.toml",
];

/// What whole runs take in QEMU, every frame of them compared: the stack that the lockstep image
/// ever used, and instructions of a step, which is every `Ecu::receive` of a tick, `Ecu::step` and `Ecu::background_step`. The
/// probe is on in the first two, so that the estimator works.
fn in_qemu(board: Board, built: Built) -> Result<Vec<Figure>> {
    let quiet = in_lock_step(board, built, "examples/live-estimate.toml")?;
    let activity = in_lock_step(board, built, "examples/driver-activity.toml")?;
    let mut worst = quiet.worst.max(activity.worst);
    for example in EVENTFUL {
        worst = worst.max(in_lock_step(board, built, example)?.worst);
    }
    let mut figures = quiet.figures("");
    figures.extend(activity.figures(", driver activity"));
    figures.push(figure("worst step, any example", "instructions", worst, 1));
    if board == Board::Mps2An386 {
        figures.extend(under_faults(built)?);
        figures.extend(with_keys(built)?);
    }
    Ok(figures)
}

/// The worst step of any row of the fault campaign: of those whose frames a bus can carry, and of all.
fn under_faults(built: Built) -> Result<Vec<Figure>> {
    let text = tool::output(&mut tool::command(built.worst_step()?))?;
    let report: Value = serde_json::from_str(&text).context("bench/worst_step.rs")?;
    let rows = report["rows"].as_array().context("worst_step counted no row")?;
    let mut figures = Vec::new();
    for (key, name) in [
        ("worst", "worst step, any fault"),
        (
            "with_any_frames",
            "worst step, any fault, more frames than a bus carries",
        ),
    ] {
        let worst = rows.iter().rev().max_by_key(|row| row[key].as_u64());
        let worst = worst.context("worst_step counted no row")?;
        println!("{name}: {}, of {} rows", worst["row"], rows.len());
        let value = worst[key].as_u64().unwrap_or_default();
        figures.push(figure(name, "instructions", value, 1));
    }
    println!(
        "not among them, because they change the ECU itself: {}",
        report["left_out"]
    );
    Ok(figures)
}

/// What authentication takes, in the drive whose steps take most.
fn with_keys(built: Built) -> Result<Vec<Figure>> {
    let mut cost = tool::command(built.host_sim()?);
    let text = tool::output(cost.args(["ecu", "cost", "--json", EVENTFUL[0]]))?;
    let costs: Value = serde_json::from_str(&text).context("host-sim ecu cost --json")?;
    let drives = costs["drives"]
        .as_array()
        .context("host-sim ecu cost drove nothing")?;
    let mut named = Vec::new();
    for drive in drives.iter().skip(1) {
        let what = drive["what"].as_str().unwrap_or_default();
        named.push((format!("worst step, {what}"), &drive["worst"]));
        named.push((format!("worst tick, {what}"), &drive["worst_tick"]));
    }
    for (mac, name) in [("siphash", "SipHash-2-4"), ("aes", "AES-CMAC")] {
        named.push((format!("a true lane preview, {name}"), &costs[mac]["taken"]));
        named.push((format!("a false lane preview, {name}"), &costs[mac]["refused"]));
    }
    let counted = named.into_iter().map(|(name, value)| {
        let value = value
            .as_u64()
            .with_context(|| format!("host-sim ecu cost counted no {name}"))?;
        Ok(figure(&name, "instructions", value, 1))
    });
    counted.collect()
}

/// What a drive takes.
struct Spent {
    stack: u64,
    worst: u64,
    mean: u64,
    background: u64,
}

impl Spent {
    /// The figures of a drive, whose law is named at the end of their names.
    fn figures(&self, law: &str) -> Vec<Figure> {
        let steps = |name: &str, value| figure(&format!("{name}{law}"), "instructions", value, 1);
        vec![
            figure(&format!("stack used{law}"), "B", self.stack, 5),
            steps("worst step", self.worst),
            steps("mean step", self.mean),
            steps("worst background step", self.background),
        ]
    }
}

fn in_lock_step(board: Board, built: Built, scenario: &str) -> Result<Spent> {
    let text = tool::output(
        tool::command(built.host_sim()?)
            .args(["ecu", "pil"])
            .args(["--machine", board.feature(), "--count", "--json"])
            .arg(scenario),
    )?;
    let report: Value = serde_json::from_str(&text).context("host-sim ecu pil --json")?;
    let steps = report["steps"].as_u64().unwrap_or(0);
    println!(
        "{}: {scenario}: {steps} steps in lock step, {} mismatches",
        board.feature(),
        report["mismatches"]
    );
    ensure!(steps > 10_000, "host-sim ecu pil stepped only {steps} times");
    let number = |value: &Value, what| {
        let value = value
            .as_f64()
            .with_context(|| format!("host-sim ecu pil measured no {what}"))?;
        Ok::<_, anyhow::Error>(value.round() as u64)
    };
    let stack = number(&report["stack_bytes"], "stack")?;
    ensure!(stack <= STACK, "{stack} B of stack, of {STACK} B");
    let spent = &report["instructions"];
    Ok(Spent {
        stack,
        worst: number(&spent["worst"], "worst step")?,
        mean: number(&spent["mean"], "mean step")?,
        background: number(&spent["worst_background"], "background")?,
    })
}

/// What a step costs a board.
pub(crate) fn bench(board: Board) -> Result<()> {
    if board.chip().is_some() {
        return run_on(board, Image::SteeringEcu);
    }
    for figure in in_qemu(board, Built::ToShip)? {
        println!("{:<30}{:>10} {}", figure.name, figure.value, figure.unit);
    }
    Ok(())
}

/// The comparison of `host-sim ecu pil`, with the board in QEMU's place.
pub(crate) fn hil(options: &Hil) -> Result<()> {
    let mut pil = tool::command(Built::ToShip.host_sim()?);
    pil.args(["ecu", "pil"]);
    match (&options.can, options.board.chip()) {
        (None, None) => pil.args(["--machine", options.board.feature()]),
        (None, Some(_)) => {
            let board = options.board.feature();
            let message = format!(
                "{board} needs a way to its bus: --can can0, --can /dev/ttyUSB0 or --can tcp:HOST:PORT"
            );
            return Err(Usage(message).into());
        }
        (Some(_), None) => {
            let board = options.board.feature();
            let message =
                format!("{board} is a machine of QEMU, which has its own way to the bus: leave out --can");
            return Err(Usage(message).into());
        }
        (Some(adapter), Some(_)) => {
            if !options.no_flash {
                flash(options.board, Image::Lockstep)?;
            }
            pil.args(["--can", adapter])
        }
    };
    let status = pil.status().context("host-sim does not start")?;
    match status.code() {
        Some(0) => Ok(()),
        // What was wrong is on the terminal.
        Some(2) => Err(Usage("no comparison".to_owned()).into()),
        _ => anyhow::bail!("the comparison failed"),
    }
}

/// Writes an image to a board and starts it.
pub(crate) fn flash(board: Board, image: Image) -> Result<()> {
    let chip = chip(board)?;
    let elf = board.build(image)?;
    run(tool::command("probe-rs")
        .args(["download", "--verify", "--chip", chip])
        .arg(elf))?;
    run(tool::command("probe-rs").args(["reset", "--chip", chip]))
}

/// Writes an image to a board, starts it and prints its log until interrupted.
pub(crate) fn run_on(board: Board, image: Image) -> Result<()> {
    let chip = chip(board)?;
    let elf = board.build(image)?;
    run(tool::command("probe-rs").args(["run", "--chip", chip]).arg(elf))
}

/// The chip to flash, if all that flashing needs is there.
fn chip(board: Board) -> Result<&'static str> {
    let Some(chip) = board.chip() else {
        let message = format!(
            "{board} is a machine of QEMU, with nothing to flash: cargo xtask qemu --board {board}",
            board = board.feature()
        );
        return Err(Usage(message).into());
    };
    if !tool::exists("probe-rs") {
        let message =
            "probe-rs is missing: cargo install probe-rs-tools, or https://probe.rs/docs/getting-started";
        return Err(Usage(message.to_owned()).into());
    }
    Ok(chip)
}
