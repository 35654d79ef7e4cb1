//! Prints `modelDescription.xml` of a model, from the list of its variables: `model-description NAME 2|3`. Without arguments: the
//! models' names.

use haptic_fmu::MODELS;
use haptic_fmu::model::About;
use haptic_fmu::variable::{Kind, Role, Variable};

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
        (Some(about), "2") => describe(about, &FMI_2, variables_2, outputs_2),
        (Some(about), "3") => describe(about, &FMI_3, variables_3, outputs_3),
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

/// What the two versions of the standard call alike things.
struct Words {
    version: &'static str,
    token: &'static str,
    state: &'static str,
    /// Elements of a quantity, a code, a flag and a text.
    types: [&'static str; 4],
}

const FMI_2: Words = Words {
    version: "2.0",
    token: "guid",
    state: "FMUstate",
    types: ["Real", "Integer", "Boolean", "String"],
};
const FMI_3: Words = Words {
    version: "3.0",
    token: "instantiationToken",
    state: "FMUState",
    types: ["Float64", "Int32", "Boolean", "String"],
};

impl Words {
    fn element(&self, kind: Kind) -> &'static str {
        self.types[match kind {
            Kind::Real => 0,
            Kind::Integer => 1,
            Kind::Boolean => 2,
            Kind::Text => 3,
        }]
    }
}

fn describe(about: &About, words: &Words, variables: fn(&About, &Words), outputs: fn(&About)) {
    let About {
        name, token, meaning, ..
    } = about;
    let Words {
        version: fmi,
        token: token_name,
        state,
        ..
    } = words;
    let version = env!("CARGO_PKG_VERSION");
    println!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="{fmi}" modelName="{name}" {token_name}="{token}" version="{version}"
    description="{meaning}" generationTool="haptic-guidance">
  <CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true"
      canGetAndSet{state}="true" canSerialize{state}="true" canBeInstantiatedOnlyOncePerProcess="false"/>"#
    );
    print_units(about);
    println!("  <DefaultExperiment startTime=\"0\" stepSize=\"0.001\"/>\n  <ModelVariables>");
    variables(about, words);
    println!("  </ModelVariables>\n  <ModelStructure>");
    outputs(about);
    println!("  </ModelStructure>\n</fmiModelDescription>");
}

/// What either version writes of a variable.
fn attributes(reference: usize, variable: &Variable) -> String {
    let (causality, variability) = roles(variable);
    let initial = if variable.role == Role::Output {
        r#" initial="exact""#
    } else {
        ""
    };
    format!(
        r#"name="{}" valueReference="{reference}" causality="{causality}" variability="{variability}"{initial} description="{}""#,
        variable.name,
        escaped(variable.meaning.trim())
    )
}

fn variables_2(about: &About, words: &Words) {
    for (reference, variable) in about.variables.iter().enumerate() {
        println!("    <ScalarVariable {}>", attributes(reference, variable));
        let element = words.element(variable.kind);
        println!("      <{element} {}/>\n    </ScalarVariable>", value(variable));
    }
}

fn variables_3(about: &About, words: &Words) {
    for (reference, variable) in about.variables.iter().enumerate() {
        let element = words.element(variable.kind);
        let end = match variable.kind {
            // A text has its start inside.
            Kind::Text => format!(r#"><Start value="{}"/></String>"#, escaped(variable.text)),
            _ => format!("{}/>", value(variable)),
        };
        println!("    <{element} {} {end}", attributes(reference, variable));
    }
    let time = about.variables.len();
    println!(
        r#"    <Float64 name="time" valueReference="{time}" causality="independent" variability="continuous" description="Time"/>"#
    );
}

/// References of the outputs. They change with steps, so that no input reaches one within an instant.
fn outputs(about: &About) -> impl Iterator<Item = usize> {
    let outputs = about.variables.iter().enumerate();
    outputs.filter_map(|(reference, variable)| (variable.role == Role::Output).then_some(reference))
}

fn outputs_2(about: &About) {
    println!("    <Outputs>");
    for reference in outputs(about) {
        println!(r#"      <Unknown index="{}" dependencies=""/>"#, reference + 1);
    }
    println!("    </Outputs>");
}

fn outputs_3(about: &About) {
    for reference in outputs(about) {
        println!(r#"    <Output valueReference="{reference}" dependencies=""/>"#);
    }
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
