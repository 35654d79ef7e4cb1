//! A table for a terminal: columns as wide as their widest cell, long headings on several lines.

use super::{Cell, Table, html, signed};

/// A heading may be as wide as this, or as its column's widest cell.
const HEADING: usize = 11;

impl Table {
    /// The table as text: caption, headings, rows, each line ended.
    pub fn to_text(&self) -> String {
        let columns: Vec<Column> = (0..self.columns.len()).map(|i| Column::new(self, i)).collect();
        let mut text = String::new();
        if !self.caption.is_empty() {
            text.push_str(&format!("{}\n", self.caption));
        }
        let lines = columns.iter().map(|c| c.heading.len()).max().unwrap_or(0);
        // Headings stand on the rows, so the upper lines of the short ones are empty.
        for line in 0..lines {
            push_line(&mut text, &columns, |c| {
                let missing = lines - c.heading.len();
                line.checked_sub(missing).map_or("", |i| &c.heading[i])
            });
        }
        for row in 0..self.rows.len() {
            push_line(&mut text, &columns, |c| &c.cells[row]);
        }
        text
    }
}

struct Column {
    heading: Vec<String>,
    cells: Vec<String>,
    width: usize,
    numeric: bool,
}

impl Column {
    fn new(table: &Table, index: usize) -> Self {
        let cell = |row: &Vec<Cell>| row.get(index).map_or_else(String::new, words);
        let cells: Vec<String> = table.rows.iter().map(cell).collect();
        let widest = cells.iter().map(|c| c.chars().count()).max().unwrap_or(0);
        let heading = broken(&table.columns[index], widest.max(HEADING));
        let numeric = cells
            .iter()
            .all(|c| c.is_empty() || c == "-" || c.parse::<f64>().is_ok());
        Self {
            width: heading
                .iter()
                .map(|h| h.chars().count())
                .max()
                .unwrap_or(0)
                .max(widest),
            heading,
            cells,
            numeric,
        }
    }
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

fn push_line<'a>(text: &mut String, columns: &'a [Column], cell: impl Fn(&'a Column) -> &'a str) {
    let padded = columns.iter().map(|c| {
        let (words, width) = (cell(c), c.width);
        if c.numeric {
            format!("{words:>width$}")
        } else {
            format!("{words:<width$}")
        }
    });
    text.push_str(padded.collect::<Vec<_>>().join("  ").trim_end());
    text.push('\n');
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
            table.to_text(),
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
}
