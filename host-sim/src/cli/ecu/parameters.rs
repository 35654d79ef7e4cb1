//! `host-sim ecu parameters [SCENARIO.toml] --can IFACE`.

use std::path::PathBuf;

use clap::Args;
use haptic_core::bus::messages::{Identity, ParameterStatus};
use haptic_core::controller::params::{PARAMETERS, Parameter, Params};
use haptic_pil::PilError;
use haptic_pil::parameters::Product;
use haptic_report::document::Table;
use serde_json::json;

use super::super::{BadInput, Outcome, print, print_json, width};
use super::{Bus, failed, keys};

#[derive(Debug, Args)]
pub(in crate::cli) struct Arguments {
    /// Scenario file (TOML, see docs/files.md) whose guidance and vehicle the ECU is to store; without one it only
    /// says what it has
    #[arg(value_name = "SCENARIO.toml")]
    scenario: Option<PathBuf>,
    #[command(flatten)]
    bus: Bus,
    /// The number of the vehicle that the set is for, 1 to 1048575, such as the last six digits of its identification
    /// number. Stored with the set; an ECU that has another vehicle's set is left alone
    #[arg(long, value_name = "NUMBER", requires = "scenario", value_parser = clap::value_parser!(u32).range(1..=i64::from(Identity::VEHICLE_MAX)))]
    vehicle_number: Option<u32>,
    /// Store the set even if the ECU has one of another vehicle
    #[arg(long, requires = "scenario")]
    other_vehicle: bool,
    /// The ECU's keys, of `cargo xtask keys`: an ECU with keys takes a set with proofs alone
    #[arg(long, value_name = "keys.toml", requires = "scenario")]
    keys: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let params = match &arguments.scenario {
        Some(path) => Some(haptic_batch::files::load_scenario(path)?.controller_params()),
        None => None,
    };
    let keys = arguments.keys.as_deref().map(keys::load).transpose()?;
    let told = Product::on(&arguments.bus.can).and_then(|mut product| {
        product.prove(keys.as_ref().map(|(keys, _)| keys));
        let status = match &params {
            Some(params) => store(&mut product, params, arguments),
            None => product.status(),
        }?;
        Ok((status, product.identity()?, product.values()?))
    });
    let (status, identity, in_use) = match told {
        Ok(told) => told,
        Err(error) => return failed(error),
    };
    if arguments.bus.json {
        print_json(&json!({
            "stored": status.stored,
            "sequence": status.sequence,
            "damaged": status.damaged,
            "vehicle_number": identity.vehicle,
            "hardware": format!("{:08X}", identity.hardware),
            "parameters": values(&in_use).collect::<serde_json::Map<_, _>>(),
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
        let vehicle = match identity.vehicle {
            0 => "no vehicle in particular".into(),
            number => format!("vehicle {number}"),
        };
        let hardware = identity.hardware;
        print(&format!(
            "the ECU (processor {hardware:08X}) uses {set}, for {vehicle}{damage}:\n\n{}",
            listing(&in_use)
        ))?;
    }
    Ok(Outcome::Good)
}

/// Unless the ECU has the set of another vehicle.
fn store(product: &mut Product, params: &Params, arguments: &Arguments) -> Result<ParameterStatus, PilError> {
    let (old, new) = (product.identity()?.vehicle, arguments.vehicle_number.unwrap_or(0));
    if old != 0 && old != new && !arguments.other_vehicle {
        return Err(PilError::Failed(format!(
            "the ECU has the set of vehicle {old}, and this one is for {}; --other-vehicle stores it all the same",
            if new == 0 {
                "no vehicle in particular".into()
            } else {
                format!("vehicle {new}")
            }
        )));
    }
    product.store(params, new)
}

/// Names and values, in the order of the list.
fn values(params: &Params) -> impl Iterator<Item = (String, serde_json::Value)> {
    PARAMETERS
        .into_iter()
        .zip(params.to_values())
        .map(|(parameter, value)| (parameter.name.to_owned(), shortest(value).into()))
}

/// The bus carries a binary32: of the doubles that it stands for, the one with the fewest digits.
fn shortest(value: f64) -> f64 {
    format!("{}", value as f32).parse().unwrap_or(value)
}

fn listing(params: &Params) -> String {
    let row = |(parameter, value): (&Parameter, f64)| {
        [
            parameter.name.to_owned(),
            shortest(value).to_string(),
            parameter.unit.to_owned(),
            format!("{} to {}", parameter.min, parameter.max),
            parameter.meaning.trim().to_owned(),
        ]
    };
    let table = Table::of_texts(
        "",
        ["parameter", "value", "unit", "range", "meaning"],
        PARAMETERS.iter().zip(params.to_values()).map(row),
    );
    table.to_text(width())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_shown_as_it_was_written_and_not_as_the_bus_rounds_it() {
        let params = Params {
            k_1: f64::from(0.3_f32),
            ..Params::PAPER
        };
        assert_ne!(params.k_1, 0.3);
        let listing = listing(&params);
        let row = listing.lines().find(|line| line.starts_with("k_1 ")).unwrap();
        assert!(
            row.contains(" 0.3 ") && row.contains("N.m") && row.contains("0 to 4"),
            "{row}"
        );
        assert_eq!(
            listing.lines().filter(|line| line.contains(" to ")).count(),
            PARAMETERS.len()
        );
    }
}
