//! The documents do what they say: their examples run, their links lead somewhere, their numbers are those of today.
//!
//! The first word behind the three backticks is the language. What follows says what the example needs:
//!
//! - `sh`: every command runs, in a directory of the document's own with the repository's files in it. `exit=N` is the
//!   exit code to expect. `cargo`: a test or a tool of the workspace that CI runs elsewhere; what it names has to be
//!   there. `hardware`: a board, QEMU or another program is needed; the command and its options have to be known.
//! - `toml file=NAME`, written there before the commands run. - `python` runs behind the commands before it;
//!   `python hardware` only has to be Python.
//! - `rust` runs as a doctest of `host-sim`; `rust file=PATH` is a part of that file.
//! - `text output`: lines that the commands before it printed; how many blanks lie between words does not matter.
//! - `text`, `mermaid` and blocks without a word are not for running.
//!
//! Commands that take long run shorter here: [`SHORTER`].

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What a reader waits for and a test does not.
const SHORTER: [(&str, &str); 4] = [
    ("--seeds 20", "--seeds 1"),
    ("--repetitions 200", "--repetitions 1"),
    ("-- experiment --probe", "-- experiment --participants 3 --probe"),
    ("-- reliance", "-- reliance --participants 3 --seeds 1"),
];

/// A directory's names in the directory that examples run in.
const LENT: [&str; 5] = ["examples", "tests", "core", "docs", "bench"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("..")
        .canonicalize()
        .unwrap()
}

/// Every document of the repository: name from the root, and text.
fn documents() -> BTreeMap<PathBuf, String> {
    let mut folders = vec![root().join("docs"), root().join("bench")];
    let mut found: Vec<PathBuf> = markdown(&root());
    while let Some(folder) = folders.pop() {
        found.extend(markdown(&folder));
        let entries = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().path());
        folders.extend(entries.filter(|path| path.is_dir()));
    }
    let read = |path: PathBuf| {
        let text = std::fs::read_to_string(&path).unwrap();
        (path.strip_prefix(root()).unwrap().to_owned(), text)
    };
    found.into_iter().map(read).collect()
}

fn markdown(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    entries
        .filter(|path| path.extension().is_some_and(|e| e == "md"))
        .collect()
}

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

/// The text without its blocks, which hold no links and no headings.
fn prose(text: &str) -> String {
    let mut inside = false;
    let mut lines = String::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            inside = !inside;
        } else if !inside {
            lines.push_str(line);
            lines.push('\n');
        }
    }
    lines
}

/// Where the commands of one document run: its own place, with the repository's folders in it.
fn place() -> tempfile::TempDir {
    let place = tempfile::tempdir().unwrap();
    for name in LENT {
        std::os::unix::fs::symlink(root().join(name), place.path().join(name)).unwrap();
    }
    place
}

/// Words of a command line; `>` and what follows it stay words.
fn words(command: &str) -> Vec<&str> {
    let command = command.split(" # ").next().unwrap_or("");
    command.split_whitespace().collect()
}

fn run(program: &mut Command, place: &Path, what: &str) -> (Option<i32>, String, String) {
    let output = program.current_dir(place).output();
    let output = output.unwrap_or_else(|e| panic!("{what}: {e}"));
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
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
        ["cargo", "run", "--release", "-p", package, "--example", example] => {
            let mut cargo = Command::new(env!("CARGO"));
            cargo.args(["run", "--quiet", "--package", package, "--example", example]);
            cargo.arg("--manifest-path").arg(root().join("Cargo.toml"));
            run(&mut cargo, place, &at)
        }
        ["cargo", "run", "--release", rest @ ..] => {
            let arguments = rest.strip_prefix(&["--"]).unwrap_or(rest);
            let mut program = Command::new(env!("CARGO_BIN_EXE_host-sim"));
            if block.has("hardware") {
                let known = knows(arguments, &mut program, place, &at);
                assert!(known, "{at}: an option is not known");
                return String::new();
            }
            run(program.args(arguments), place, &at)
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
    let command = arguments.first().filter(|w| !w.starts_with('-'));
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
            for k in (0..rest.len()).filter(|k| rest[*k] == "--test") {
                let file = folder.join("tests").join(rest[k + 1]).with_extension("rs");
                assert!(file.exists(), "{at}: {} is not there", file.display());
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
                    } else if block.has("cargo") || line.starts_with("cargo xtask") {
                        exists(line, &at);
                    } else {
                        let text = run_line(line, &block, place.path(), &at);
                        printed.extend(text.lines().map(evenly));
                    }
                    seen += 1;
                }
            }
            "python" => python(&block, place.path(), &at),
            "rust" => {
                if let Some(file) = block.value("file") {
                    let source = std::fs::read_to_string(root().join(file)).unwrap();
                    assert!(source.contains(&block.text), "{at}: {file} has other lines");
                } else {
                    let lib = include_str!("../src/lib.rs");
                    let shown = format!("include_str!(\"../../{}\")", name.display());
                    assert!(lib.contains(&shown), "{at}: host-sim/src/lib.rs does not run it");
                }
            }
            "text" if block.has("output") => {
                for line in block.text.lines().map(evenly) {
                    assert!(printed.contains(&line), "{at}: nothing printed {line:?}");
                }
            }
            "text" | "mermaid" | "" => {}
            other => panic!("{at}: nobody runs {other}"),
        }
    }
    println!("{}: {seen} commands", name.display());
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

/// A heading's anchor, as GitHub and GitLab make it.
fn anchors(text: &str) -> Vec<String> {
    let mut anchors: Vec<String> = Vec::new();
    let mut times: BTreeMap<String, u32> = BTreeMap::new();
    for line in prose(text).lines().filter(|line| line.starts_with('#')) {
        let title = line.trim_start_matches('#').trim().to_lowercase();
        let kept = title
            .chars()
            .filter(|c| c.is_alphanumeric() || [' ', '-', '_'].contains(c));
        let anchor: String = kept.collect::<String>().replace(' ', "-");
        let count = times.entry(anchor.clone()).or_default();
        anchors.push(match *count {
            0 => anchor,
            n => format!("{anchor}-{n}"),
        });
        *count += 1;
    }
    anchors
}

/// Targets of the links of a text: what stands between `](` and `)`.
fn links(text: &str) -> Vec<String> {
    let prose = words_of(text);
    let after = prose.split("](").skip(1);
    after
        .filter_map(|rest| Some(rest.split_once(')')?.0.to_owned()))
        .collect()
}

#[test]
fn every_link_leads_somewhere() {
    let documents = documents();
    for (name, text) in &documents {
        for link in links(text) {
            if link.contains("://") || link.starts_with("mailto:") {
                continue;
            }
            let (file, anchor) = link.split_once('#').unwrap_or((&link, ""));
            let target = match file {
                "" => root().join(name),
                file => root().join(name).parent().unwrap().join(file),
            };
            assert!(target.exists(), "{}: {link} is not there", name.display());
            let target = target.canonicalize().unwrap();
            let Some(text) = documents.get(target.strip_prefix(root()).unwrap()) else {
                continue;
            };
            let found = anchor.is_empty() || anchors(text).iter().any(|a| a == anchor);
            assert!(found, "{}: {link}: no such heading", name.display());
        }
    }
}

/// A file that a document names from the repository's root is there.
#[test]
fn every_file_that_is_named_is_there() {
    let tops = [
        "core/",
        "firmware/",
        "host-sim/",
        "tests/",
        "xtask/",
        "docs/",
        "examples/",
        "bench/",
    ];
    for (name, text) in documents() {
        let prose = prose(&text);
        let code = prose.split('`').skip(1).step_by(2);
        for word in code.flat_map(str::split_whitespace) {
            let is_path = tops.iter().any(|top| word.starts_with(top));
            // `firmware/src/boards/<board>.x` is a pattern.
            if is_path && !word.contains(['<', '*']) {
                assert!(
                    root().join(word).exists(),
                    "{}: {word} is not there",
                    name.display()
                );
            }
        }
    }
}

/// Words that a reader cannot know, and a pattern is one of them where letters do not go on.
const TERMS: [(&str, &str); 14] = [
    ("reliance", "#reliance"),
    ("K_hg", "#k_hg"),
    ("T_d", "#t_d"),
    ("T_h", "#t_h"),
    ("t_p", "#t_p"),
    ("K_d", "#k_d"),
    ("gain_i", "#gain_i"),
    ("probe", "#probe"),
    ("remnant", "#remnant"),
    ("handover", "#handover"),
    ("lane preview", "#lane-preview"),
    ("envelope", "#envelope"),
    ("lock-step", "#lock-step"),
    ("e_theta", "#e_y-and-e_theta"),
];

/// Where a term stands for the first time as a word of its own.
fn first(text: &str, term: &str) -> Option<usize> {
    let part = |c: char| c.is_alphanumeric() || c == '_' || c == '-' || c == '/' || c == '.';
    let lower = text.to_lowercase();
    let places = lower
        .match_indices(&term.to_lowercase())
        .map(|(at, _)| at)
        .collect::<Vec<_>>();
    places.into_iter().find(|&at| {
        let before = lower[..at].chars().next_back();
        let after = lower[at + term.len()..].chars().next();
        !before.is_some_and(part) && !after.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == '-')
    })
}

/// Text without code in backticks and without headings, which may name what the text then defines.
fn words_of(text: &str) -> String {
    let prose = prose(text);
    let lines = prose.lines().filter(|line| !line.starts_with('#'));
    let text = lines.collect::<Vec<_>>().join("\n");
    text.split('`').step_by(2).collect::<Vec<_>>().join("_")
}

/// The first time that a document uses a term, it leads to the glossary.
#[test]
fn a_term_is_defined_before_its_use() {
    let glossary = std::fs::read_to_string(root().join("docs/glossary.md")).unwrap();
    let headings = anchors(&glossary);
    let mut wrong = Vec::new();
    for (name, text) in documents() {
        if ["docs/glossary.md", "CHANGELOG.md"]
            .iter()
            .any(|own| name == Path::new(own))
        {
            continue;
        }
        let text = words_of(&text);
        for (term, anchor) in TERMS {
            assert!(
                headings.iter().any(|a| a == &anchor[1..]),
                "docs/glossary.md: no {anchor}"
            );
            let Some(at) = first(&text, term) else { continue };
            let link = text[at..]
                .split("](")
                .nth(1)
                .and_then(|rest| rest.split(')').next());
            let inside = !text[at..]
                .split("](")
                .next()
                .unwrap_or("")
                .contains([']', '\n', '[']);
            if !inside || !link.is_some_and(|link| link.contains("glossary.md")) {
                let line: String = text[at..].chars().take(40).collect();
                wrong.push(format!("{}: {term}: {:?}", name.display(), line));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "not defined before its use:\n{}",
        wrong.join("\n")
    );
}

/// Every command of the program has its row in the reference.
#[test]
fn the_reference_names_every_command() {
    let place = place();
    let (_, help, _) = run(
        Command::new(env!("CARGO_BIN_EXE_host-sim")).arg("--help"),
        place.path(),
        "--help",
    );
    let commands = help
        .split("Commands:\n")
        .nth(1)
        .unwrap()
        .split("\n\n")
        .next()
        .unwrap();
    let names: Vec<_> = commands
        .lines()
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect();
    assert!(names.len() > 9, "{names:?}");
    let reference = std::fs::read_to_string(root().join("docs/reference/commands.md")).unwrap();
    for name in names {
        let [row, row_with_arguments] = [format!("\n| `{name}`"), format!("\n| `{name} ")];
        let named = reference.contains(&row) || reference.contains(&row_with_arguments);
        assert!(named, "docs/reference/commands.md: no row for {name}");
    }
}

/// A number of the goldens with thousands set apart, as documents write it.
fn golden(name: &str) -> String {
    let text = std::fs::read_to_string(root().join("xtask/golden.json")).unwrap();
    let goldens: BTreeMap<String, u64> = serde_json::from_str(&text).unwrap();
    let digits = goldens[name].to_string();
    let groups = digits.as_bytes().rchunks(3).rev();
    let groups: Vec<_> = groups
        .map(|group| String::from_utf8_lossy(group).into_owned())
        .collect();
    groups.join(",")
}

/// What `cargo xtask` measured and keeps is what the documents say.
#[test]
fn instruction_counts_in_documents_are_those_of_the_goldens() {
    let documents = documents();
    let has = |name: &str, sentence: String| {
        let text = documents[Path::new(name)].replace('\n', " ");
        assert!(text.contains(&sentence), "{name} should say: {sentence}");
    };
    let porting = "docs/porting.md";
    let share = |count: &str| {
        let count: f64 = count.replace(',', "").parse().unwrap();
        // Two cycles an instruction, 170,000 cycles in a tick.
        format!("{:.1} %", 2.0 * count / 170e3 * 100.0)
    };
    for (row, key) in [
        ("mean", "mps2-an386 mean step"),
        ("worst", "mps2-an386 worst step"),
    ] {
        let count = golden(key);
        has(porting, format!("| {row} | {count} | {} |", share(&count)));
    }
    let worst: f64 = golden("mps2-an386 worst step").replace(',', "").parse().unwrap();
    let slower = 2.0 * worst / 120e3 * 100.0;
    has(
        porting,
        format!("At the SAM E54's 120 MHz the worst step is {slower:.1} % of a tick."),
    );
    let background = golden("mps2-an386 worst background step");
    has(
        "docs/numerics.md",
        format!("at most {background} instructions on the target"),
    );
    let per_ms = golden("host_simulated_second")
        .replace(',', "")
        .parse::<f64>()
        .unwrap()
        / 1000.0;
    let thousands = format!("{},{:03}", per_ms as u64 / 1000, per_ms as u64 % 1000);
    has(
        "docs/numerics.md",
        format!("A simulated millisecond takes {thousands} instructions."),
    );
    has(
        "docs/numerics.md",
        format!("The ECU's step takes {} of them.", golden("host_step_mean")),
    );
}
