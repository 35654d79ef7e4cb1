//! A report for a terminal. A table has columns as wide as their widest cell, long headings on several lines.
//!
//! A table that is wider than the terminal breaks headings and long cells between words. What is still too wide loses
//! columns from the right, and a line below names them: so the first columns of a table are those that matter most.

use haptic_log::Event;

use super::{Block, Cell, Report, Table, html, signed};

/// A heading may be as wide as this, or as its column's widest cell.
const HEADING: usize = 11;

/// Cells of words are not broken to less than this.
const WORDS: usize = 24;

/// Blanks between two columns.
const GAP: &str = "  ";

impl Report {
    /// What a terminal shows of it: all but the figures and what is for the page alone. Lines are at most `width` long if there
    /// is one.
    pub fn to_text(&self, width: Option<usize>) -> String {
        let shown = self.sections.iter().map(|section| {
            let blocks = section.blocks.iter().filter_map(|block| block_text(block, width));
            (section.heading.as_str(), blocks.collect::<Vec<_>>())
        });
        let shown: Vec<_> = shown.filter(|(_, blocks)| !blocks.is_empty()).collect();
        let mut parts = vec![wrapped(&self.title, width), wrapped(&self.summary, width)];
        let has_several = shown.len() > 1;
        for (heading, blocks) in shown {
            if has_several {
                parts.push(format!("{heading}\n{}\n", "-".repeat(heading.chars().count())));
            }
            parts.extend(blocks);
        }
        parts.retain(|part| !part.is_empty());
        parts.join("\n")
    }
}

fn block_text(block: &Block, width: Option<usize>) -> Option<String> {
    let text = match block {
        Block::Text(text) => wrapped(text, width),
        Block::Table(table) if table.rows.is_empty() => return None,
        Block::Table(table) => table.to_text(width),
        Block::Events(events) => {
            let line = |event: &Event| format!("{:9.3} s  {}\n", event.time_s, event.what);
            events.iter().map(line).collect()
        }
        Block::OnTerminal(block) => return block_text(block, width),
        Block::Figure { .. } | Block::OnPage(_) => return None,
    };
    Some(text)
}

impl Table {
    /// The table as text: caption, headings, rows, each line ended. Lines are at most `width` long if there is one.
    pub fn to_text(&self, width: Option<usize>) -> String {
        let limit = width.unwrap_or(usize::MAX);
        let mut columns: Vec<TextColumn> = (0..self.columns.len())
            .map(|i| TextColumn::new(self, i))
            .collect();
        while columns.len() > 1 && span(columns.iter().map(|c| c.least)) > limit {
            columns.pop();
        }
        while span(columns.iter().map(|c| c.width)) > limit {
            let narrowed = columns.iter_mut().filter(|c| c.width > c.least);
            match narrowed.max_by_key(|c| c.width) {
                Some(widest) => widest.width -= 1,
                None => break,
            }
        }
        let mut text = wrapped(&self.caption, width);
        let headings = columns.iter().map(|c| broken(c.heading, c.width)).collect();
        push_lines(&mut text, &columns, headings, true);
        for row in 0..self.rows.len() {
            let cells = columns.iter().map(|c| broken(&c.cells[row], c.width)).collect();
            push_lines(&mut text, &columns, cells, false);
        }
        let left_out = self.columns[columns.len()..].join("; ");
        if !left_out.is_empty() {
            let note = format!("At a width of {limit} this table leaves out: {left_out}.");
            text.push_str(&wrapped(&note, width));
        }
        text
    }

    /// The table's headings and rows in Markdown.
    pub fn to_markdown(&self) -> String {
        let line = |cells: &mut dyn Iterator<Item = String>| {
            let cells: Vec<String> = cells.map(|cell| cell.replace('|', "\\|")).collect();
            format!("| {} |\n", cells.join(" | "))
        };
        let mut text = line(&mut self.columns.iter().cloned());
        text.push_str(&format!("|{}\n", "---|".repeat(self.columns.len())));
        for row in &self.rows {
            text.push_str(&line(&mut row.iter().map(words)));
        }
        text
    }
}

struct TextColumn<'a> {
    heading: &'a str,
    cells: Vec<String>,
    /// Where there is room.
    width: usize,
    /// Narrower it cannot be read.
    least: usize,
    numeric: bool,
}

impl<'a> TextColumn<'a> {
    fn new(table: &'a Table, index: usize) -> Self {
        let cell = |row: &Vec<Cell>| row.get(index).map_or_else(String::new, words);
        let cells: Vec<String> = table.rows.iter().map(cell).collect();
        let heading = table.columns[index].as_str();
        let widest = longest(cells.iter().map(String::as_str));
        let numeric = cells
            .iter()
            .all(|c| c.is_empty() || c == "-" || c.parse::<f64>().is_ok());
        let unbroken = longest(cells.iter().flat_map(|c| c.split_whitespace()));
        let lines = broken(heading, widest.max(HEADING));
        Self {
            width: longest(lines.iter().map(String::as_str)).max(widest),
            least: longest(heading.split_whitespace()).max(widest.min(unbroken.max(WORDS))),
            heading,
            cells,
            numeric,
        }
    }
}

/// How long a line of columns is.
fn span(widths: impl Iterator<Item = usize>) -> usize {
    widths
        .map(|width| width + GAP.len())
        .sum::<usize>()
        .saturating_sub(GAP.len())
}

fn longest<'a>(texts: impl Iterator<Item = &'a str>) -> usize {
    texts.map(|text| text.chars().count()).max().unwrap_or(0)
}

/// A cell in plain ASCII where it is a number; a dash where there is none.
fn words(cell: &Cell) -> String {
    match cell {
        Cell::Text(text) => text.clone(),
        Cell::Signed(value) => signed(*value),
        Cell::Number { value, decimals } => match value.filter(|v| v.is_finite()) {
            None => "-".into(),
            some => html::number(some, *decimals),
        },
    }
}

/// Text with every line ended, those that are too long broken between words.
pub(super) fn wrapped(text: &str, width: Option<usize>) -> String {
    let fits = |line: &str| width.is_none_or(|width| line.chars().count() <= width);
    let lines = text.lines().flat_map(|line| match width {
        Some(width) if !fits(line) => broken(line, width),
        _ => vec![line.to_owned()],
    });
    lines.map(|line| line + "\n").collect()
}

/// Text on lines of at most `width`, broken between words.
fn broken(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.into()),
        }
    }
    lines
}

/// Cells of several lines beside each other, the short ones at the top or, as headings stand on their columns, at the bottom.
fn push_lines(text: &mut String, columns: &[TextColumn], cells: Vec<Vec<String>>, at_the_bottom: bool) {
    let lines = cells.iter().map(Vec::len).max().unwrap_or(0);
    for line in 0..lines {
        let padded = columns.iter().zip(&cells).map(|(column, cell)| {
            let missing = if at_the_bottom { lines - cell.len() } else { 0 };
            let words = line.checked_sub(missing).and_then(|line| cell.get(line));
            let (words, width) = (words.map_or("", String::as_str), column.width);
            if column.numeric {
                format!("{words:>width$}")
            } else {
                format!("{words:<width$}")
            }
        });
        text.push_str(padded.collect::<Vec<_>>().join(GAP).trim_end());
        text.push('\n');
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stand_at_the_right_and_words_at_the_left_under_headings_of_several_lines() {
        let row = |name: &str, value| {
            let number = Cell::Number { value, decimals: 3 };
            vec![Cell::Text(name.into()), number]
        };
        let table = Table {
            caption: "Two runs.".into(),
            columns: ["run", "Peak lateral error (m)"].map(String::from).to_vec(),
            rows: vec![row("a", Some(0.12345)), row("long", None), row("x", Some(-1e-9))],
        };
        assert_eq!(
            table.to_text(None),
            concat!(
                "Two runs.\n",
                "           Peak\n",
                "        lateral\n",
                "run   error (m)\n",
                "a         0.123\n",
                "long          -\n",
                "x         0.000\n",
            )
        );
    }

    fn table(columns: &[&str], row: Vec<Cell>) -> Table {
        Table {
            caption: String::new(),
            columns: columns.iter().map(ToString::to_string).collect(),
            rows: vec![row],
        }
    }

    /// Twelve columns of 7 characters, two of them with headings of 8: 7 + 11 * 9 + 2 = 108. The headings may break.
    #[test]
    fn columns_that_do_not_fit_are_left_out_from_the_right_and_named() {
        let columns: Vec<String> = (0..12).map(|k| format!("c{k} km/h")).collect();
        let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
        let row = [Cell::Text("drive".into())].into_iter();
        let row = row.chain((1..12).map(|k| Cell::number(f64::from(k), 5)));
        let table = table(&columns, row.collect());
        let lines = |width| -> Vec<String> { table.to_text(width).lines().map(String::from).collect() };
        assert_eq!(lines(None).len(), 2);
        assert_eq!(lines(None)[1].len(), 108);
        for (width, last) in [(80, 8), (100, 10)] {
            let lines = lines(Some(width));
            assert!(lines.iter().all(|line| line.len() <= width), "{lines:#?}");
            let shown = lines.iter().find(|line| line.starts_with("drive")).unwrap();
            assert_eq!(shown.split_whitespace().count(), last + 1, "{lines:#?}");
            let note = format!("At a width of {width} this table leaves out: c{} km/h", last + 1);
            assert!(lines.iter().any(|line| line.starts_with(&note)), "{lines:#?}");
        }
    }

    #[test]
    fn words_break_before_a_column_is_left_out() {
        let sentence = "guidance helps greatly, the more the higher the reliance";
        let cells = ["holds", sentence, "0.143, 0.161, 0.200, 0.223 m"];
        let cells = cells.map(|text| Cell::Text(text.into())).to_vec();
        let table = table(&["Verdict", "Claim", "Evidence"], cells);
        assert_eq!(
            table.to_text(Some(80)),
            concat!(
                "Verdict  Claim                                      Evidence\n",
                "holds    guidance helps greatly, the more the       0.143, 0.161, 0.200, 0.223 m\n",
                "         higher the reliance\n",
            )
        );
        assert_eq!(table.to_text(Some(100)).lines().count(), 2);
    }
}
