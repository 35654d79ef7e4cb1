//! Tables in the documents, between two marks.

use std::collections::BTreeMap;

use anyhow::{Context, Result, ensure};

use super::kept::Kept;
use super::list::List;
use super::{replace, tables};
use crate::tool::{command, output, root};

const BEGIN: &str = "<!-- evidence: ";
const END: &str = "<!-- evidence ends -->";

/// Writes every table that is not what is kept.
pub(super) fn write(list: &List, kept: &BTreeMap<String, Kept>) -> Result<()> {
    for (document, text, wanted) in documents(list, kept)? {
        if text != wanted {
            replace(&root().join(&document), &wanted)?;
            println!("{document}");
        }
    }
    Ok(())
}

/// Documents with tables that are not what is kept, each with the first line that differs.
pub(super) fn differing(list: &List, kept: &BTreeMap<String, Kept>) -> Result<Vec<String>> {
    let mut wrong = Vec::new();
    for (document, text, wanted) in documents(list, kept)? {
        let lines = (1..).zip(text.lines().zip(wanted.lines()));
        let first = lines.clone().find(|(_, (is, should))| is != should);
        if let Some((number, (_, should))) = first {
            wrong.push(format!("{document}:{number}: what was measured is: {should}"));
        } else if text != wanted {
            wrong.push(format!("{document}: its end is not what was measured"));
        }
    }
    Ok(wrong)
}

/// Each document that has tables: its name, its text, and what it should be.
fn documents(list: &List, kept: &BTreeMap<String, Kept>) -> Result<Vec<(String, String, String)>> {
    let mut documents: BTreeMap<&str, (String, String)> = BTreeMap::new();
    for (name, table) in &list.table {
        let document = table.document.as_str();
        if !documents.contains_key(document) {
            let text = std::fs::read_to_string(root().join(document)).with_context(|| document.to_owned())?;
            documents.insert(document, (text.clone(), text));
        }
        let (_, wanted) = documents.get_mut(document).context("it was put there")?;
        *wanted =
            with_table(wanted, name, &tables::render(list, table, kept)).context(document.to_owned())?;
    }
    // A mark without a table would look as if its figures were kept.
    let marked = output(command("git").args(["grep", "--no-color", "-hF", BEGIN, "--", "*.md"]))?;
    for line in marked.lines() {
        let name = line.trim().trim_start_matches(BEGIN).trim_end_matches(" -->");
        ensure!(
            list.table.contains_key(name),
            "{line}: no such table in {}",
            super::LIST
        );
    }
    let documents = documents.into_iter();
    Ok(documents
        .map(|(name, (text, wanted))| (name.to_owned(), text, wanted))
        .collect())
}

/// A text with a table between its marks.
fn with_table(text: &str, name: &str, table: &str) -> Result<String> {
    let begin = format!("{BEGIN}{name} -->\n");
    let (before, rest) = text
        .split_once(&begin)
        .with_context(|| format!("no {}", begin.trim()))?;
    ensure!(!rest.contains(&begin), "{} stands there twice", begin.trim());
    let end = rest
        .find(END)
        .with_context(|| format!("no {END} after {}", begin.trim()))?;
    ensure!(!rest[..end].contains(BEGIN), "no {END} after {}", begin.trim());
    Ok(format!("{before}{begin}{table}{}", &rest[end..]))
}

#[cfg(test)]
mod tests {
    use super::with_table;

    #[test]
    fn a_table_is_put_between_its_own_marks() {
        let text = "A\n<!-- evidence: a -->\nold\n<!-- evidence ends -->\nB\n<!-- evidence: b -->\n<!-- evidence ends -->\n";
        let with_a = with_table(text, "a", "new\n").unwrap();
        assert_eq!(with_a, text.replace("old\n", "new\n"));
        let with_b = with_table(text, "b", "new\n").unwrap();
        assert_eq!(with_b, text.replace("b -->\n", "b -->\nnew\n"));
        assert!(with_table(text, "c", "").is_err());
        assert!(with_table(&format!("{text}{text}"), "a", "").is_err());
        assert!(with_table(&text.replacen("<!-- evidence ends -->\n", "", 1), "a", "").is_err());
    }
}
