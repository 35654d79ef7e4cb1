//! The examples of the documents run.
//!
//! The first word behind the three backticks is the language. What follows says what the example needs:
//!
//! - `sh`: every command runs, in a directory of the document's own with the repository's files in it. `exit=N` is the
//!   exit code to expect. `cargo`: a test or a tool of the workspace that CI runs elsewhere; what it names has to be
//!   there. `hardware`: a board, a machine on a port or another program is needed; the command and its options have to be known.
//!   `setup` installs something and is not run. `checkout`: it runs in the repository itself, and writes nothing.
//! - `toml file=NAME`, written there before the commands run. - `python` runs behind the commands before it;
//!   `python hardware` only has to be Python.
//! - `rust` runs as a doctest of `host-sim`. `rust file=PATH` and `python file=PATH` are a part of that file.
//! - `text output`: lines, or beginnings of lines, that the commands before it printed; how many blanks lie between words does not
//!   matter.
//! - A sentence's numbers are compared by `<!-- of: COMMAND -->`: see `passages`.
//! - `text`, `mermaid`, `math` and blocks without a word are not for running.
//!
//! Commands that take long run shorter here: [`SHORTER`].

use std::path::{Path, PathBuf};
use std::process::Command;

use super::passages::passages;
use super::{documents, place, root, run};
use crate::{EVIDENCE, built, program};

/// What a reader waits for and a test does not.
const SHORTER: [(&str, &str); 4] = [
    ("--seeds 20", "--seeds 1"),
    ("-- experiment --probe", "-- experiment --participant 3 --probe"),
    ("xtask reliance", "xtask reliance --participant 3 --seeds 1"),
    ("xtask handover", "xtask handover --every 5"),
];

/// A fenced block: its first line without the backticks, and its text.
struct Block {
    line: usize,
    info: String,
    text: String,
}

impl Block {
    fn language(&self) -> &str {
        self.info.split_whitespace().next().unwrap_or("")
    }

    fn has(&self, word: &str) -> bool {
        self.info.split_whitespace().any(|w| w == word)
    }

    fn value(&self, key: &str) -> Option<&str> {
        self.info
            .split_whitespace()
            .find_map(|w| w.strip_prefix(key)?.strip_prefix('='))
    }
}

fn blocks(text: &str) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut open: Option<(Block, usize)> = None;
    for (number, line) in text.lines().enumerate() {
        let indent = line.len() - line.trim_start().len();
        match (&mut open, line.trim_start().strip_prefix("```")) {
            (None, Some(info)) => {
                let (line, info) = (number + 1, info.trim().to_owned());
                let text = String::new();
                open = Some((Block { line, info, text }, indent));
            }
            (Some(_), Some("")) => blocks.extend(open.take().map(|(block, _)| block)),
            (Some((block, indent)), _) => {
                // A block in a list is indented as the list is.
                block.text.push_str(line.get(*indent..).unwrap_or(""));
                block.text.push('\n');
            }
            (None, None) => {}
        }
    }
    assert!(open.is_none(), "a block without an end");
    blocks
}

/// Whether a line is for xtask itself, and not for the program of evidence behind it.
fn is_of_xtask(line: &str) -> bool {
    let command = line
        .strip_prefix("cargo xtask ")
        .and_then(|rest| rest.split(' ').next());
    command.is_some_and(|command| !EVIDENCE.contains(&command))
}

/// Words of a command line; `>` and what follows it stay words.
fn words(command: &str) -> Vec<&str> {
    let command = command.split(" # ").next().unwrap_or("");
    command.split_whitespace().collect()
}

/// Runs one line of an `sh` block; what it printed.
fn run_line(line: &str, block: &Block, place: &Path, at: &str) -> String {
    let shorter = SHORTER
        .iter()
        .fold(line.to_owned(), |line, (long, short)| line.replace(long, short));
    let all = words(&shorter);
    let (all, into) = match all.iter().position(|w| *w == ">") {
        Some(k) => (&all[..k], Some(all[k + 1])),
        None => (&all[..], None),
    };
    let at = format!("{at}: {line}");
    let (code, out, err) = match all {
        [
            "cargo",
            "run",
            "--release",
            "-p",
            "host-sim",
            "--example",
            example,
        ] => {
            let place_of = Path::new("examples").join(example);
            let program = built(&place_of, &["-p", "host-sim", "--example", example]);
            run(&mut Command::new(program), place, &at)
        }
        ["cargo", "run", "--release", rest @ ..] | ["cargo", "xtask", rest @ ..] => {
            let arguments = rest.strip_prefix(&["--"]).unwrap_or(rest);
            let mut program = program(arguments.first().copied());
            if block.has("hardware") {
                let known = knows(arguments, &mut program, place, &at);
                assert!(known, "{at}: an option is not known");
                return String::new();
            }
            let place = if block.has("checkout") {
                root()
            } else {
                place.to_path_buf()
            };
            run(program.args(arguments), &place, &at)
        }
        ["python3", ..] => {
            let script = shorter.split(" > ").next().unwrap_or("");
            run(Command::new("sh").args(["-c", script]), place, &at)
        }
        _ => panic!("{at}: not a command that this test can check; mark the block"),
    };
    let expected = block.value("exit").map_or(0, |code| code.parse().unwrap());
    assert_eq!(code, Some(expected), "{at}\n{err}");
    if let Some(file) = into {
        std::fs::write(place.join(file), &out).unwrap();
    }
    out + &err
}

/// Whether a command's help has the options that the line names.
fn knows(arguments: &[&str], program: &mut Command, place: &Path, at: &str) -> bool {
    let levels = match arguments {
        ["ecu", "diag", ..] => 3,
        ["ecu", ..] => 2,
        _ => 1,
    };
    let command = arguments.iter().take(levels).filter(|w| !w.starts_with('-'));
    let (code, help, err) = run(program.args(command).arg("--help"), place, at);
    assert_eq!(code, Some(0), "{at}\n{err}");
    let mut options = arguments.iter().filter(|w| w.starts_with("--"));
    options.all(|option| help.contains(*option))
}

/// What a `cargo` line names has to be there: an alias, a package, a test.
fn exists(line: &str, at: &str) {
    let all = words(line);
    let at = format!("{at}: {line}");
    match all[..] {
        ["cargo", "xtask", command, ..] => {
            let main = std::fs::read_to_string(root().join("xtask/src/main.rs")).unwrap();
            let variant = command[..1].to_uppercase() + &command[1..];
            let commands = main.split("enum Command {").nth(1).unwrap();
            let known = commands.lines().any(|l| {
                let name = l.trim_start().split(['(', ',', ' ']).next();
                name == Some(variant.as_str())
            });
            assert!(known, "{at}: no such command of xtask");
        }
        ["cargo", "test", ref rest @ ..] => {
            let package = rest
                .iter()
                .position(|w| *w == "-p")
                .map_or("haptic-guidance", |k| rest[k + 1]);
            let folder = package_folder(package, &at);
            for module in rest.iter().filter_map(|word| word.strip_suffix("::")) {
                let test = folder.join("tests").join(module);
                let is_there = test.with_extension("rs").exists() || test.join("mod.rs").exists();
                assert!(is_there, "{at}: {} is not there", test.display());
            }
        }
        ["cargo", "run", "--release", ..] => {}
        _ => panic!("{at}: not a command that this test knows"),
    }
}

fn package_folder(package: &str, at: &str) -> PathBuf {
    let mut folders = vec![root()];
    for top in ["core", "firmware", "host-sim", "xtask", "bindings"] {
        folders.push(root().join(top));
        let entries = std::fs::read_dir(root().join(top)).into_iter().flatten();
        folders.extend(
            entries
                .map(|entry| entry.unwrap().path())
                .filter(|path| path.is_dir()),
        );
    }
    let name = format!("name = \"{package}\"");
    let named = |folder: &PathBuf| {
        let manifest = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap_or_default();
        manifest.lines().any(|line| line == name)
    };
    let found = folders.into_iter().find(named);
    found.unwrap_or_else(|| panic!("{at}: no package {package}"))
}

fn python(block: &Block, place: &Path, at: &str) {
    let script = place.join("example.py");
    std::fs::write(&script, &block.text).unwrap();
    let mut python = Command::new("python3");
    if block.has("hardware") {
        python.args(["-m", "py_compile"]);
    }
    let (code, _, err) = run(python.arg(&script), place, "python3 (Debian package python3)");
    assert_eq!(code, Some(0), "{at}\n{err}");
}

/// Words with one blank between them.
fn evenly(line: &str) -> String {
    line.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Runs the examples of one document in their order.
fn run_examples(name: &Path, text: &str) {
    let place = place();
    let mut seen = 0;
    let mut printed = Vec::new();
    let mut of_line: Vec<(String, String)> = Vec::new();
    for block in blocks(text) {
        let at = format!("{}:{}", name.display(), block.line);
        match block.language() {
            "toml" => {
                let file = block
                    .value("file")
                    .unwrap_or_else(|| panic!("{at}: give it a file's name"));
                std::fs::write(place.path().join(file), &block.text).unwrap();
            }
            "sh" => {
                for line in block.text.lines().filter(|line| !words(line).is_empty()) {
                    if block.has("setup") {
                        continue;
                    } else if block.has("cargo") || is_of_xtask(line) {
                        exists(line, &at);
                    } else {
                        let text = run_line(line, &block, place.path(), &at);
                        printed.extend(text.lines().map(evenly));
                        of_line.push((line.into(), text));
                    }
                    seen += 1;
                }
            }
            "python" | "rust" if block.value("file").is_some() => {
                let file = block.value("file").unwrap_or_default();
                let source = std::fs::read_to_string(root().join(file)).unwrap();
                assert!(source.contains(&block.text), "{at}: {file} has other lines");
            }
            "python" => python(&block, place.path(), &at),
            "rust" => {
                let lib = include_str!("../../src/lib.rs");
                let shown = format!("include_str!(\"../../{}\")", name.display());
                assert!(lib.contains(&shown), "{at}: host-sim/src/lib.rs does not run it");
            }
            "text" if block.has("output") => {
                for line in block.text.lines().map(evenly) {
                    let is_there = printed.iter().any(|printed| printed.starts_with(&line));
                    assert!(is_there, "{at}: nothing printed {line:?}");
                }
            }
            "text" | "mermaid" | "math" | "" => {}
            other => panic!("{at}: nobody runs {other}"),
        }
    }
    check_passages(name, text, &of_line, place.path());
    println!("{}: {seen} commands", name.display());
}

/// What the commands of a document printed has the numbers of its passages.
fn check_passages(name: &Path, text: &str, printed: &[(String, String)], place: &Path) {
    for passage in passages(text) {
        let command = passage.command;
        let at = format!("{}: {command}", name.display());
        let own = printed.iter().find(|(line, _)| line.contains(command));
        let alone = Block {
            line: 0,
            info: "sh".into(),
            text: String::new(),
        };
        let wrong = match own {
            Some((_, printed)) => passage.wrong(printed),
            None => passage.wrong(&run_line(command, &alone, place, &at)),
        };
        assert!(wrong.is_empty(), "{at}: it did not print {wrong:?}");
    }
}

#[test]
fn the_examples_of_every_document_run() {
    // A panic in a document's thread is passed on when all have ended, so that one run names every wrong example.
    let documents = documents();
    std::thread::scope(|scope| {
        for (name, text) in &documents {
            scope.spawn(move || run_examples(name, text));
        }
    });
}
