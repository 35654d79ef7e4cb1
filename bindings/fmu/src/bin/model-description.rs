//! Prints `modelDescription.xml` of a model, from the list of its variables: `model-description NAME 2|3`. Without arguments: the
//! models' names.

use haptic_fmu::MODELS;
use haptic_fmu::variable::{About, Kind, Role, Variable};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, version] = &arguments[..] else {
        for about in MODELS {
            println!("{}", about.name);
        }
        return;
    };
    let about = MODELS.into_iter().find(|about| about.name == name);
    match (about, version.as_str()) {
        (Some(about), "2") => version_2(about),
        (Some(about), "3") => version_3(about),
        _ => {
            eprintln!("error: {name} {version}: a model's name and 2 or 3 are wanted");
            std::process::exit(2);
        }
    }
}

fn units(about: &About) -> Vec<&'static str> {
    let mut units: Vec<_> = about.variables.iter().filter_map(unit).collect();
    units.sort_unstable();
    units.dedup();
    units
}

fn print_units(about: &About) {
    println!("  <UnitDefinitions>");
    for unit in units(about) {
        println!(r#"    <Unit name="{unit}"/>"#);
    }
    println!("  </UnitDefinitions>");
}

fn version_2(about: &About) {
    let About {
        name, token, meaning, ..
    } = about;
    let version = env!("CARGO_PKG_VERSION");
    println!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{token}" version="{version}"
    description="{meaning}" generationTool="haptic-guidance">
  <CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true"
      canGetAndSetFMUstate="true" canSerializeFMUstate="true" canBeInstantiatedOnlyOncePerProcess="false"/>"#
    );
    print_units(about);
    println!("  <DefaultExperiment startTime=\"0\" stepSize=\"0.001\"/>\n  <ModelVariables>");
    for (reference, variable) in about.variables.iter().enumerate() {
        let (causality, variability) = roles(variable);
        let initial = if variable.role == Role::Output {
            r#" initial="exact""#
        } else {
            ""
        };
        println!(
            r#"    <ScalarVariable name="{}" valueReference="{reference}" causality="{causality}" variability="{variability}"{initial} description="{}">"#,
            variable.name,
            escaped(variable.meaning.trim())
        );
        let element = match variable.kind {
            Kind::Real => "Real",
            Kind::Integer => "Integer",
            Kind::Boolean => "Boolean",
            Kind::Text => "String",
        };
        println!("      <{element} {}/>\n    </ScalarVariable>", value(variable));
    }
    println!("  </ModelVariables>\n  <ModelStructure>\n    <Outputs>");
    for (i, variable) in about.variables.iter().enumerate() {
        if variable.role == Role::Output {
            // Outputs change with steps, so that no input reaches one within an instant.
            println!(r#"      <Unknown index="{}" dependencies=""/>"#, i + 1);
        }
    }
    println!("    </Outputs>\n  </ModelStructure>\n</fmiModelDescription>");
}

fn version_3(about: &About) {
    let About {
        name, token, meaning, ..
    } = about;
    let version = env!("CARGO_PKG_VERSION");
    println!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="{name}" instantiationToken="{token}" version="{version}"
    description="{meaning}" generationTool="haptic-guidance">
  <CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true"
      canGetAndSetFMUState="true" canSerializeFMUState="true" canBeInstantiatedOnlyOncePerProcess="false"/>"#
    );
    print_units(about);
    println!("  <DefaultExperiment startTime=\"0\" stepSize=\"0.001\"/>\n  <ModelVariables>");
    for (reference, variable) in about.variables.iter().enumerate() {
        let (causality, variability) = roles(variable);
        let initial = if variable.role == Role::Output {
            r#" initial="exact""#
        } else {
            ""
        };
        let element = match variable.kind {
            Kind::Real => "Float64",
            Kind::Integer => "Int32",
            Kind::Boolean => "Boolean",
            Kind::Text => "String",
        };
        // A text has its start inside.
        let (value, end) = match variable.kind {
            Kind::Text => (
                String::new(),
                format!(r#"><Start value="{}"/></String>"#, escaped(variable.text)),
            ),
            _ => (value(variable), "/>".to_owned()),
        };
        println!(
            r#"    <{element} name="{}" valueReference="{reference}" causality="{causality}" variability="{variability}"{initial} description="{}" {value}{end}"#,
            variable.name,
            escaped(variable.meaning.trim())
        );
    }
    let time = about.variables.len();
    println!(
        r#"    <Float64 name="time" valueReference="{time}" causality="independent" variability="continuous" description="Time"/>
  </ModelVariables>
  <ModelStructure>"#
    );
    for (reference, variable) in about.variables.iter().enumerate() {
        if variable.role == Role::Output {
            println!(r#"    <Output valueReference="{reference}" dependencies=""/>"#);
        }
    }
    println!("  </ModelStructure>\n</fmiModelDescription>");
}

fn roles(variable: &Variable) -> (&'static str, &'static str) {
    match (variable.role, variable.kind) {
        (Role::Input, Kind::Real) => ("input", "continuous"),
        (Role::Input, _) => ("input", "discrete"),
        (Role::Output, Kind::Real) => ("output", "continuous"),
        (Role::Output, _) => ("output", "discrete"),
        (Role::Parameter, _) => ("parameter", "fixed"),
        (Role::Tunable, _) => ("parameter", "tunable"),
    }
}

fn unit(variable: &Variable) -> Option<&'static str> {
    Some(variable.unit).filter(|unit| !["", "1"].contains(unit))
}

/// Start, unit and range of a variable.
fn value(variable: &Variable) -> String {
    let start = variable.start;
    match variable.kind {
        Kind::Real => {
            let unit = unit(variable).map_or(String::new(), |unit| format!(r#" unit="{unit}""#));
            let range = variable
                .range
                .map_or(String::new(), |[min, max]| format!(r#" min="{min}" max="{max}""#));
            format!(r#"start="{start}"{unit}{range}"#)
        }
        Kind::Integer => format!(r#"start="{start}""#),
        Kind::Boolean => format!(r#"start="{}""#, start != 0.0),
        Kind::Text => format!(r#"start="{}""#, escaped(variable.text)),
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}
