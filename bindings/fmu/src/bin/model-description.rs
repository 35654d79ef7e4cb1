//! Prints `modelDescription.xml` of the FMU, from the list of its variables.

use haptic_fmu::controller::{Kind, Role, VARIABLES, Variable};
use haptic_fmu::{GUID, MODEL};

fn main() {
    let version = env!("CARGO_PKG_VERSION");
    println!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="{MODEL}" guid="{GUID}" version="{version}"
    description="The shipping haptic-guidance ECU: SI values in, torque out" generationTool="haptic-guidance">
  <CoSimulation modelIdentifier="{MODEL}" canHandleVariableCommunicationStepSize="true"
      canGetAndSetFMUstate="true" canBeInstantiatedOnlyOncePerProcess="false"/>
  <UnitDefinitions>"#
    );
    let mut units: Vec<_> = VARIABLES.iter().filter_map(unit).collect();
    units.sort_unstable();
    units.dedup();
    for unit in units {
        println!(r#"    <Unit name="{unit}"/>"#);
    }
    println!(
        "  </UnitDefinitions>\n  <DefaultExperiment startTime=\"0\" stepSize=\"0.001\"/>\n  <ModelVariables>"
    );
    for (reference, variable) in VARIABLES.iter().enumerate() {
        print_variable(reference, variable);
    }
    println!("  </ModelVariables>\n  <ModelStructure>\n    <Outputs>");
    for (i, variable) in VARIABLES.iter().enumerate() {
        if variable.role == Role::Output {
            // Outputs change with steps, so that no input reaches one within an instant.
            println!(r#"      <Unknown index="{}" dependencies=""/>"#, i + 1);
        }
    }
    println!("    </Outputs>\n  </ModelStructure>\n</fmiModelDescription>");
}

fn unit(variable: &Variable) -> Option<&'static str> {
    Some(variable.unit).filter(|unit| !["", "1"].contains(unit))
}

fn print_variable(reference: usize, variable: &Variable) {
    let (causality, variability, initial) = match (variable.role, variable.kind) {
        (Role::Input, Kind::Real) => ("input", "continuous", ""),
        (Role::Input, _) => ("input", "discrete", ""),
        (Role::Output, Kind::Real) => ("output", "continuous", r#" initial="exact""#),
        (Role::Output, _) => ("output", "discrete", r#" initial="exact""#),
        (Role::Parameter, _) => ("parameter", "fixed", ""),
    };
    let description = escaped(variable.meaning.trim());
    println!(
        r#"    <ScalarVariable name="{}" valueReference="{reference}" causality="{causality}" variability="{variability}"{initial} description="{description}">"#,
        variable.name
    );
    let start = variable.start;
    match variable.kind {
        Kind::Real => {
            let unit = unit(variable).map_or(String::new(), |unit| format!(r#" unit="{unit}""#));
            let range = variable
                .range
                .map_or(String::new(), |[min, max]| format!(r#" min="{min}" max="{max}""#));
            println!(r#"      <Real start="{start}"{unit}{range}/>"#);
        }
        Kind::Integer => println!(r#"      <Integer start="{start}"/>"#),
        Kind::Boolean => println!(r#"      <Boolean start="{}"/>"#, start != 0.0),
    }
    println!("    </ScalarVariable>");
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}
