//! Names of the command line: the commands by purpose, and what is said of a name that is none.

use std::ffi::OsString;
use std::fmt::Write;

use clap::CommandFactory;
use clap::error::{ContextKind, ContextValue, ErrorKind};

use super::Cli;

/// The commands as `--help` lists them.
const GROUPS: [(&str, &str); 4] = [
    ("The paper", "evaluate experiment"),
    (
        "Drive",
        "run sweep compare design-guidance assist driver-torque course stability lab",
    ),
    ("People", "identify identify-vehicle drivers design study convert"),
    ("The ECU on a bus", "ecu"),
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
        .mut_subcommands(|command| signed(command).mut_subcommands(signed))
}

/// A value may begin with a minus: what is wrong with it is its range.
pub fn signed(command: clap::Command) -> clap::Command {
    command.mut_args(|option| {
        let takes_values = option.get_action().takes_values();
        option.allow_negative_numbers(takes_values)
    })
}

/// A sentence with its numbers as they were written, in options (`--rate 1e9`) and in fields of the files among the words.
pub(super) fn as_written(mut sentence: String, words: &[String]) -> String {
    let files = words.iter().filter(|word| word.ends_with(".toml"));
    let files: Vec<String> = files
        .filter_map(|file| std::fs::read_to_string(file).ok())
        .collect();
    let fields = files
        .iter()
        .flat_map(|text| text.split(['\n', ',', '{', '}', '#']));
    let pairs = words.iter().map(String::as_str).chain(fields);
    let pairs = pairs.filter_map(|pair| pair.split_once('='));
    let options = words.windows(2).map(|pair| (&pair[0][..], &pair[1][..]));
    for (name, text) in pairs.chain(options) {
        let (name, text) = (name.trim(), text.trim());
        if let Ok(value) = text.replace('_', "").parse::<f64>()
            && value.is_finite()
            && !name.is_empty()
        {
            for (sign, end) in [(" = ", " "), (" ", ":")] {
                let said = format!("{name}{sign}{value}{end}");
                sentence = sentence.replace(&said, &format!("{name}{sign}{text}{end}"));
            }
        }
    }
    sentence
}

/// The sentence for a command of the ECU without `ecu`, or for an option of the evaluation without its command.
pub(super) fn explain(error: &clap::Error, arguments: &[OsString]) -> Option<String> {
    let kind = match error.kind() {
        ErrorKind::InvalidSubcommand => ContextKind::InvalidSubcommand,
        ErrorKind::UnknownArgument => ContextKind::InvalidArg,
        _ => return None,
    };
    let Some(ContextValue::String(name)) = error.get(kind) else {
        return None;
    };
    let words: Vec<_> = arguments
        .iter()
        .skip(1)
        .map(|word| word.to_string_lossy())
        .collect();
    let first = words.first()?;
    let program = Cli::command();
    if program.find_subcommand("ecu")?.find_subcommand(name).is_some() {
        return Some(format!(
            "there is no command `{name}`; did you mean `host-sim ecu {name}`?"
        ));
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

    /// A terminal of 80 columns shows each line whole: these lines are not wrapped.
    #[test]
    fn a_line_of_the_list_fits() {
        let help = grouped(Cli::command()).render_help().to_string();
        for line in help.lines() {
            assert!(line.chars().count() <= 80, "{line}");
        }
    }
}
