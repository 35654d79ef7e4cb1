//! Tables for a terminal: columns as wide as their widest cell.

/// Lines of cells; the first line holds the headings. Cells that are numbers or a dash are set at the right.
pub(super) fn text(lines: &[Vec<String>]) -> String {
    let columns = lines.iter().map(Vec::len).max().unwrap_or(0);
    let cells = |column: usize| lines.iter().filter_map(move |line| line.get(column));
    let widths: Vec<usize> = (0..columns)
        .map(|c| cells(c).map(|cell| cell.chars().count()).max().unwrap_or(0))
        .collect();
    let numeric: Vec<bool> = (0..columns)
        .map(|c| {
            cells(c)
                .skip(1)
                .all(|cell| cell == "-" || cell.parse::<f64>().is_ok())
        })
        .collect();
    let mut text = String::new();
    for line in lines {
        let padded = line.iter().enumerate().map(|(column, cell)| {
            let width = widths[column];
            if numeric[column] {
                format!("{cell:>width$}")
            } else {
                format!("{cell:<width$}")
            }
        });
        text.push_str(padded.collect::<Vec<_>>().join("  ").trim_end());
        text.push('\n');
    }
    text
}

/// A number with `decimals` digits after the point; a dash where there is none.
pub(super) fn number(value: Option<f64>, decimals: usize) -> String {
    value.map_or("-".into(), |value| format!("{value:.decimals$}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stand_at_the_right_and_words_at_the_left() {
        let lines = [
            ["run", "peak"],
            ["a", &number(Some(0.12345), 3)],
            ["long", &number(None, 3)],
        ];
        let lines = lines.map(|line| line.map(String::from).to_vec());
        assert_eq!(text(&lines), "run    peak\na     0.123\nlong      -\n");
    }
}
