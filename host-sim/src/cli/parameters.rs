//! `host-sim parameters [SCENARIO.toml] --can IFACE`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::NonEmptyStringValueParser;
use haptic_target::PilError;
use haptic_target::parameters::Product;
use serde_json::json;

use super::{BadInput, Outcome, print, print_json};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Scenario file (TOML, see docs/files.md) whose guidance and vehicle the ECU is to store; without one it only
    /// says what it has
    #[arg(value_name = "SCENARIO.toml")]
    scenario: Option<PathBuf>,
    /// The way to the bus: a CAN interface (can0), the serial port of an SLCAN adapter (/dev/ttyUSB0), or
    /// tcp:HOST:PORT
    #[arg(long, value_name = "IFACE", value_parser = NonEmptyStringValueParser::new())]
    can: String,
    /// Print the result as one JSON object
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let params = match &arguments.scenario {
        Some(path) => Some(haptic_batch::files::load_scenario(path)?.controller_params()),
        None => None,
    };
    let status = Product::on(&arguments.can).and_then(|mut product| match &params {
        Some(params) => product.store(params),
        None => product.status(),
    });
    let status = match status {
        Ok(status) => status,
        Err(error @ PilError::Missing(_)) => return Err(error.into()),
        Err(error) => {
            eprintln!("error: {error}");
            return Ok(Outcome::Failed);
        }
    };
    if arguments.json {
        print_json(&json!({
            "stored": status.stored,
            "sequence": status.sequence,
            "damaged": status.damaged,
        }))?;
    } else {
        let set = if status.stored {
            format!("set {} of its flash", status.sequence)
        } else {
            "the set built into its image".into()
        };
        let damage = if status.damaged {
            "; a copy cannot be read"
        } else {
            ""
        };
        print(&format!("the ECU uses {set}{damage}"))?;
    }
    Ok(Outcome::Good)
}
