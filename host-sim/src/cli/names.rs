//! Names of the command line: the commands by purpose, and what a name of an older version is called today.

use std::ffi::OsString;
use std::fmt::Write;

use clap::error::{ContextKind, ContextValue, ErrorKind};

/// The commands as `--help` lists them.
const GROUPS: [(&str, &str); 5] = [
    ("The paper", "evaluate experiment"),
    (
        "Drive",
        "run sweep compare design-guidance adaptation course stability lab",
    ),
    (
        "People",
        "identify identify-vehicle drivers real-drives design study validate convert",
    ),
    ("The ECU in simulation", "faults availability handover reliance"),
    ("The ECU on a bus", "ecu"),
];

/// Command (none: the program itself), name of an older version, what replaces it.
const RENAMED: [(&str, &str, &str); 17] = [
    ("", "pil", "host-sim ecu pil"),
    ("", "live", "host-sim ecu live"),
    ("", "parameters", "host-sim ecu parameters"),
    ("", "bus", "host-sim ecu bus"),
    ("ecu", "--listen", "host-sim ecu run --listen"),
    ("ecu", "--for", "host-sim ecu run --for"),
    ("identify", "--whole", "--no-preprocessing"),
    ("identify", "--bridge", "--max-gap"),
    ("identify", "--exact-lane", "--no-lane-smoothing"),
    ("sweep", "--plan", "--dry-run"),
    ("study", "--plan", "--dry-run"),
    ("experiment", "--coverage", "host-sim validate --coverage"),
    ("experiment", "--repetitions", "host-sim validate --coverage"),
    ("experiment", "--spoiled", "host-sim validate --corruptions"),
    ("experiment", "--methods", "host-sim validate --methods"),
    ("experiment", "--only", "host-sim validate --only"),
    ("availability", "--most-per-hour", "--max-rate"),
];

/// The program's help with its commands in groups, which clap itself has not.
pub(super) fn grouped(program: clap::Command) -> clap::Command {
    let header = *program.get_styles().get_header();
    let literal = *program.get_styles().get_literal();
    let mut help = String::from("{about-with-newline}\n{usage-heading} {usage}\n");
    for (title, names) in GROUPS {
        let _ = writeln!(help, "\n{header}{title}:{header:#}");
        for command in names.split(' ').filter_map(|name| program.find_subcommand(name)) {
            let about = command.get_about().map(ToString::to_string).unwrap_or_default();
            let _ = writeln!(help, "  {literal}{:<16} {literal:#}{about}", command.get_name());
        }
    }
    let _ = write!(help, "\n{header}Options:{header:#}\n{{options}}{{after-help}}");
    program
        .help_template(help)
        .mut_subcommands(|command| with_signs(command).mut_subcommands(with_signs))
}

/// A value may begin with a minus: what is wrong with it is its range.
fn with_signs(command: clap::Command) -> clap::Command {
    command.mut_args(|option| {
        let takes_values = option.get_action().takes_values();
        option.allow_negative_numbers(takes_values)
    })
}

/// The sentence for a name of an older version, or for an option of the evaluation without its command.
pub(super) fn explain(error: &clap::Error, arguments: &[OsString]) -> Option<String> {
    let kind = match error.kind() {
        ErrorKind::InvalidSubcommand => ContextKind::InvalidSubcommand,
        ErrorKind::UnknownArgument => ContextKind::InvalidArg,
        _ => return None,
    };
    let Some(ContextValue::String(name)) = error.get(kind) else {
        return None;
    };
    let words = arguments.iter().skip(1);
    let words: Vec<String> = words.map(|word| word.to_string_lossy().into_owned()).collect();
    let first = words.first()?;
    let is_it =
        |(command, old, _): &&(&str, &str, &str)| name == old && (command.is_empty() || first == command);
    let renamed = RENAMED.iter().find(is_it);
    if let Some((_, old, new)) = renamed {
        return Some(format!("`{old}` is `{new}`"));
    }
    // A command of the ECU, or what looks like one.
    let of_ecu = |(_, old, new): &&(&str, &str, &'static str)| {
        new.starts_with("host-sim ecu ") && (old.starts_with(name.as_str()) || name.starts_with(old))
    };
    if let Some((.., new)) = RENAMED
        .iter()
        .find(of_ecu)
        .filter(|_| name.len() > 2 && name == first)
    {
        return Some(format!("there is no command `{name}`; did you mean `{new}`?"));
    }
    let own_option = name.starts_with('-') && first.starts_with('-');
    own_option.then(|| {
        format!(
            "`{name}` is no option without a command; for one of the evaluation: `host-sim evaluate {}`",
            words.join(" ")
        )
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use clap::CommandFactory;

    use super::super::Cli;
    use super::*;

    #[test]
    fn every_command_is_in_one_group() {
        let program = Cli::command();
        let all: Vec<&str> = program.get_subcommands().map(clap::Command::get_name).collect();
        let grouped: Vec<&str> = GROUPS.iter().flat_map(|(_, names)| names.split(' ')).collect();
        assert_eq!(grouped.len(), all.len());
        assert_eq!(
            grouped.into_iter().collect::<BTreeSet<_>>(),
            all.into_iter().collect()
        );
    }

    /// As a terminal of 80 columns shows it: these lines are not wrapped.
    #[test]
    fn a_line_of_the_list_fits() {
        let help = grouped(Cli::command()).render_help().to_string();
        for line in help.lines() {
            assert!(line.chars().count() <= 80, "{line}");
        }
    }
}
