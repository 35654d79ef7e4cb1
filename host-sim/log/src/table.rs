//! Tables of text fields under a heading row: CSV as people and programs write it.
//!
//! Written: RFC 4180 with a comma, a point as decimal sign and LF. Read: the same, with semicolons or tabs where the heading
//! has no comma, with CR LF, a byte order mark, blanks around fields, empty lines and lines that begin with `#` passed over. Every row knows the line that it
//! stands on. Not here: what the columns mean.

use std::io::{self, Cursor, Read, Write};

/// Why a table was refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// It cannot be read at all.
    #[error("{0}")]
    Unreadable(String),
    /// A row cannot be read.
    #[error("line {line}: {what}")]
    Row {
        /// Its line, the first of the file being 1.
        line: u64,
        /// Why.
        what: String,
    },
    /// A row has another number of fields than the heading.
    #[error("line {line}: {found} fields where the header has {expected}")]
    Fields {
        /// Its line.
        line: u64,
        /// Its fields.
        found: usize,
        /// Those of the heading.
        expected: usize,
    },
    /// A column that is needed is not there.
    #[error("there is no column {0}")]
    MissingColumn(String),
    /// A field that has to be a number is none.
    #[error("line {line}: {column} is {text:?}, which is not a number{}", hint(text))]
    NotANumber {
        /// Its line.
        line: u64,
        /// The name of its column.
        column: String,
        /// What it holds.
        text: String,
    },
}

/// What a text needs to be a number, where it is a decimal comma.
fn hint(text: &str) -> &'static str {
    if text.replacen(',', ".", 1).parse::<f64>().is_ok() {
        ": the decimal sign is a point"
    } else {
        ""
    }
}

/// A row of a table.
#[derive(Debug, Clone)]
pub struct Row {
    /// The line of the file that it stands on, from 1.
    pub line: u64,
    fields: csv::StringRecord,
}

impl Row {
    /// The field of a column of the heading.
    #[must_use]
    pub fn field(&self, column: usize) -> &str {
        &self.fields[column]
    }
}

/// A table that is being read.
pub struct TableReader {
    header: Vec<String>,
    header_line: u64,
    /// Lines of the rows: the parser counts neither skipped lines nor those that end in CR and LF.
    lines: std::vec::IntoIter<u64>,
    reader: csv::Reader<Cursor<String>>,
}

impl TableReader {
    /// Reads the source and its heading.
    ///
    /// # Errors
    /// What cannot be read.
    pub fn new(mut source: impl Read) -> Result<Self, TableError> {
        let mut bytes = Vec::new();
        let read = source.read_to_end(&mut bytes);
        read.map_err(|e| TableError::Unreadable(e.to_string()))?;
        let text = String::from_utf8_lossy(&bytes);
        let (lines, kept): (Vec<u64>, Vec<&str>) = (1..)
            .zip(text.trim_start_matches('\u{feff}').lines())
            .filter(|(_, line)| !line.starts_with('#') && !line.trim().is_empty())
            .unzip();
        let mut lines = lines.into_iter();
        let heading = kept.first().copied().unwrap_or_default();
        let separator = |c: &char| !heading.contains(',') && heading.contains(*c);
        let mut reader = csv::ReaderBuilder::new()
            .delimiter([';', '\t'].into_iter().find(separator).map_or(b',', |c| c as u8))
            .trim(csv::Trim::All)
            .flexible(true)
            .from_reader(Cursor::new(kept.join("\n")));
        let header = reader.headers();
        let header = header.map_err(|e| TableError::Unreadable(e.to_string()))?;
        Ok(Self {
            header: header.iter().map(str::to_owned).collect(),
            header_line: lines.next().unwrap_or(1),
            lines,
            reader,
        })
    }

    /// Names of the columns, as they are written.
    #[must_use]
    pub fn header(&self) -> &[String] {
        &self.header
    }

    /// The line of the heading, from 1.
    #[must_use]
    pub fn header_line(&self) -> u64 {
        self.header_line
    }

    /// The rows, in order; all have as many fields as the heading.
    pub fn rows(&mut self) -> impl Iterator<Item = Result<Row, TableError>> {
        let expected = self.header.len();
        let row = move |(record, line): (Result<csv::StringRecord, csv::Error>, u64)| {
            let unreadable = |what: String| TableError::Row { line, what };
            let fields = record.map_err(|e| unreadable(e.to_string()))?;
            match fields.len() {
                found if found == expected => Ok(Row { line, fields }),
                found => Err(TableError::Fields {
                    line,
                    found,
                    expected,
                }),
            }
        };
        self.reader.records().zip(self.lines.by_ref()).map(row)
    }
}

/// A table that is being written.
pub struct TableWriter<W: Write>(csv::Writer<W>);

impl<W: Write> TableWriter<W> {
    /// Writes the heading.
    ///
    /// # Errors
    /// What `out` says.
    pub fn new<T: AsRef<[u8]>>(out: W, names: impl IntoIterator<Item = T>) -> io::Result<Self> {
        let mut writer = csv::Writer::from_writer(out);
        writer.write_record(names)?;
        Ok(Self(writer))
    }

    /// Writes a row.
    ///
    /// # Errors
    /// What `out` says; another number of fields than the heading has.
    pub fn row<T: AsRef<[u8]>>(&mut self, fields: impl IntoIterator<Item = T>) -> io::Result<()> {
        Ok(self.0.write_record(fields)?)
    }

    /// Writes what is not yet written.
    ///
    /// # Errors
    /// What `out` says.
    pub fn finish(mut self) -> io::Result<()> {
        self.0.flush()
    }
}

/// What loggers write where there is no value.
const NOTHING: [&str; 6] = ["", "-", "na", "n/a", "nan", "null"];

/// A field as a number: NaN where it says that there is none, nothing where it is a text.
#[must_use]
pub fn number(field: &str) -> Option<f64> {
    let nothing = || NOTHING.contains(&field.trim().to_ascii_lowercase().as_str());
    field.parse().ok().or_else(|| nothing().then_some(f64::NAN))
}

/// A number with so many digits after the point. A zero has no sign.
#[must_use]
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    if text.contains(|c: char| ('1'..='9').contains(&c)) {
        text
    } else {
        text.trim_start_matches('-').into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quotes and doubled quotes are RFC 4180's own example.
    #[test]
    fn rows_know_their_lines_whatever_stands_between() {
        let text = "\u{feff}# made by hand\r\n\r\na, b\r\n1,\"x \"\"y\"\"\"\r\n# pause\r\n2,\r\n";
        let mut table = TableReader::new(text.as_bytes()).unwrap();
        assert_eq!(
            (table.header(), table.header_line()),
            (&["a".into(), "b".into()][..], 3)
        );
        let rows: Vec<_> = table.rows().map(Result::unwrap).collect();
        let found: Vec<_> = rows.iter().map(|r| (r.line, r.field(0), r.field(1))).collect();
        assert_eq!(found, [(4, "1", "x \"y\""), (6, "2", "")]);
    }

    #[test]
    fn a_row_with_another_number_of_fields_is_refused_with_its_line() {
        let mut table = TableReader::new(&b"a,b\n1,2\n\n3\n"[..]).unwrap();
        let error = table.rows().nth(1).unwrap().unwrap_err();
        assert_eq!(error.to_string(), "line 4: 1 fields where the header has 2");
    }

    #[test]
    fn semicolons_and_tabs_separate_where_the_heading_has_no_comma() {
        for text in ["a;b\n1;2,5", "a\tb\n1\t2,5", "a,b\n1,\"2,5\""] {
            let mut table = TableReader::new(text.as_bytes()).unwrap();
            assert_eq!(table.header(), ["a", "b"]);
            let row = table.rows().next().unwrap().unwrap();
            assert_eq!((number(row.field(0)), row.field(1)), (Some(1.0), "2,5"));
            let text = row.field(1).to_owned();
            let (line, column) = (row.line, "b".into());
            let says = "line 2: b is \"2,5\", which is not a number: the decimal sign is a point";
            assert_eq!(TableError::NotANumber { line, column, text }.to_string(), says);
        }
    }

    #[test]
    fn a_zero_has_no_sign() {
        let texts = [(-1e-9, 3), (-0.0016, 3), (2.5, 0)].map(|(value, n)| fixed(value, n));
        assert_eq!(texts, ["0.000", "-0.002", "2"]);
    }
}
