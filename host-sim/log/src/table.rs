//! Tables of text fields under a heading row: CSV as people and programs write it.
//!
//! Written: RFC 4180 with a comma, a point as decimal sign and LF. Read: the same, with semicolons or tabs where the heading
//! has no comma, or what a line `sep=;` before it says; with CR LF or CR, a byte order mark, blanks around fields; empty lines
//! and lines that begin with `#` are passed over. A row is on the line on which it ends. Not here: what the columns mean.

use std::borrow::Cow;
use std::io::{self, BufRead, BufReader, Read, Write};

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
#[derive(Debug, Clone, Copy)]
pub struct Row<'a> {
    /// The line of the file that it stands on, from 1.
    pub line: u64,
    fields: &'a csv::ByteRecord,
}

impl<'a> Row<'a> {
    /// The field of a column of the heading.
    #[must_use]
    pub fn field(self, column: usize) -> Cow<'a, str> {
        String::from_utf8_lossy(self.fields[column].trim_ascii())
    }
}

/// A text whose lines end in LF, the last one too, whatever they ended in.
struct Lf<R> {
    source: R,
    last: u8,
    after_cr: bool,
    /// Whether the last line did not end.
    is_open: bool,
}

impl<R: Read> Read for Lf<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        loop {
            let read = self.source.read(out)?;
            if read == 0 {
                let is_open = self.last != b'\n' && !out.is_empty();
                if is_open {
                    (self.last, out[0]) = (b'\n', b'\n');
                    self.is_open = true;
                }
                return Ok(usize::from(is_open));
            }
            let mut kept = read;
            if self.after_cr || out[..read].contains(&b'\r') {
                kept = 0;
                for place in 0..read {
                    let byte = out[place];
                    if !(self.after_cr && byte == b'\n') {
                        out[kept] = if byte == b'\r' { b'\n' } else { byte };
                        kept += 1;
                    }
                    self.after_cr = byte == b'\r';
                }
            }
            if kept > 0 {
                self.last = out[kept - 1];
                return Ok(kept);
            }
        }
    }
}

/// A table that is being read.
pub struct TableReader<R> {
    header: Vec<String>,
    header_line: u64,
    reader: csv::Reader<BufReader<Lf<R>>>,
    fields: csv::ByteRecord,
    cut: Option<u64>,
}

impl<R: Read> TableReader<R> {
    /// Reads the source's heading.
    ///
    /// # Errors
    /// What cannot be read.
    pub fn new(source: R) -> Result<Self, TableError> {
        let unreadable = |e: &dyn std::fmt::Display| TableError::Unreadable(e.to_string());
        let (last, after_cr, is_open) = (b'\n', false, false);
        let mut source = BufReader::new(Lf {
            source,
            last,
            after_cr,
            is_open,
        });
        let (mut header_line, mut separator) = (1, None);
        let heading = loop {
            let mut line = Vec::new();
            let read = source.read_until(b'\n', &mut line);
            if read.map_err(|e| unreadable(&e))? == 0 {
                break line;
            }
            if header_line == 1 && (line.starts_with(&[0xFF, 0xFE]) || line.starts_with(&[0xFE, 0xFF])) {
                return Err(unreadable(&"this is UTF-16: save it as UTF-8"));
            }
            let text = line.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&line);
            let text = text.strip_suffix(b"\n").unwrap_or(text);
            let quoted = text.strip_prefix(b"\"").and_then(|rest| rest.strip_suffix(b"\""));
            match quoted.unwrap_or(text) {
                // As Excel writes it.
                &[s, e, p, b'=', said] if [s, e, p].eq_ignore_ascii_case(b"sep") => separator = Some(said),
                _ if text.starts_with(b"#") || text.trim_ascii().is_empty() => {}
                _ => break text.to_vec(),
            }
            header_line += 1;
        };
        let is_there = |c: &u8| !heading.contains(&b',') && heading.contains(c);
        let usual = [b';', b'\t'].into_iter().find(is_there).unwrap_or(b',');
        let mut table = csv::ReaderBuilder::new();
        table
            .delimiter(separator.unwrap_or(usual))
            .comment(Some(b'#'))
            .has_headers(false)
            .flexible(true);
        let mut names = csv::ByteRecord::new();
        let read = table.from_reader(&heading[..]).read_byte_record(&mut names);
        read.map_err(|e| unreadable(&e))?;
        Ok(Self {
            header: names.iter().map(name).collect(),
            header_line,
            reader: table.from_reader(source),
            fields: csv::ByteRecord::new(),
            cut: None,
        })
    }

    /// The line within which the file ends, if it does: its row is none.
    #[must_use]
    pub fn cut(&self) -> Option<u64> {
        self.cut
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

    /// The next row, with as many fields as the heading; none behind the last one.
    ///
    /// # Errors
    /// What cannot be read, another number of fields.
    pub fn next_row(&mut self) -> Result<Option<Row<'_>>, TableError> {
        let expected = self.header.len();
        loop {
            let read = self.reader.read_byte_record(&mut self.fields);
            // Counted are ends of lines, so that this is the line behind the row.
            let line = self.header_line + self.reader.position().line() - 1;
            let unreadable = |e: csv::Error| TableError::Row {
                line,
                what: e.to_string(),
            };
            if !read.map_err(unreadable)? {
                return Ok(None);
            }
            let is_blank = self.fields.len() == 1 && self.fields[0].trim_ascii().is_empty();
            match self.fields.len() {
                found if found == expected && !is_blank => break,
                _ if is_blank => {}
                found if found < expected && self.is_last()? => {
                    self.cut = Some(line);
                    return Ok(None);
                }
                found => {
                    return Err(TableError::Fields {
                        line,
                        found,
                        expected,
                    });
                }
            }
        }
        let line = self.header_line + self.reader.position().line() - 1;
        let fields = &self.fields;
        Ok(Some(Row { line, fields }))
    }
}

impl<R: Read> TableReader<R> {
    /// Whether the row that was read is the last one, and its line does not end.
    fn is_last(&mut self) -> Result<bool, TableError> {
        if !self.reader.get_ref().get_ref().is_open {
            return Ok(false);
        }
        let more = self.reader.read_byte_record(&mut csv::ByteRecord::new());
        Ok(!more.map_err(|e| TableError::Unreadable(e.to_string()))?)
    }
}

/// A name of the heading; what is not UTF-8 is Latin-1, as older programs write a degree sign.
fn name(field: &[u8]) -> String {
    let field = field.trim_ascii();
    let latin = || field.iter().map(|byte| char::from(*byte)).collect();
    String::from_utf8(field.to_vec()).unwrap_or_else(|_| latin())
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
const NOTHING: [&str; 12] = [
    "", "-", "--", "na", "n/a", "#n/a", "<na>", "nan", "nil", "none", "null", "missing",
];

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

    fn rows(table: &mut TableReader<&[u8]>) -> Vec<(u64, String, String)> {
        let mut rows = Vec::new();
        while let Some(row) = table.next_row().unwrap() {
            rows.push((row.line, row.field(0).into(), row.field(1).into()));
        }
        rows
    }

    /// Python's csv reads these rows, and counts these lines, of each of the texts.
    #[test]
    fn lines_end_in_lf_cr_or_both_and_the_last_one_in_nothing() {
        for text in [
            "a,b\n1,2\n3,4",
            "a,b\r1,2\r3,4\r",
            "a,b\r\n1,2\r3,4\n",
            "a,b\r1,2\r\n3,4\r\n",
        ] {
            let mut table = TableReader::new(text.as_bytes()).unwrap();
            assert_eq!(table.header(), ["a", "b"], "{text:?}");
            let expected = [(2, "1".into(), "2".into()), (3, "3".into(), "4".into())];
            assert_eq!(rows(&mut table), expected, "{text:?}");
        }
        let mut table = TableReader::new(&b"sep=;\r\na;b,\xB0\r\n1;\"2\n\n3\"\r\n4;5"[..]).unwrap();
        assert_eq!(
            (table.header(), table.header_line()),
            (&["a".into(), "b,\u{b0}".into()][..], 2)
        );
        let expected = [(5, "1".into(), "2\n\n3".into()), (6, "4".into(), "5".into())];
        assert_eq!(rows(&mut table), expected);
    }

    /// Quotes and doubled quotes are RFC 4180's own example.
    #[test]
    fn rows_know_their_lines_whatever_stands_between() {
        let text = "\u{feff}# made by hand\r\n\r\na, b\r\n1,\"x \"\"y\"\"\"\r\n# pause\r\n2,\r\n";
        let mut table = TableReader::new(text.as_bytes()).unwrap();
        assert_eq!(
            (table.header(), table.header_line()),
            (&["a".into(), "b".into()][..], 3)
        );
        assert_eq!(
            rows(&mut table),
            [(4, "1".into(), "x \"y\"".into()), (6, "2".into(), String::new())]
        );
    }

    #[test]
    fn a_row_with_another_number_of_fields_is_refused_with_its_line() {
        let mut table = TableReader::new(&b"a,b\n1,2\n\n3\n"[..]).unwrap();
        assert!(table.next_row().is_ok());
        let error = table.next_row().unwrap_err();
        assert_eq!(table.cut(), None);
        assert_eq!(error.to_string(), "line 4: 1 fields where the header has 2");
    }

    #[test]
    fn a_last_row_that_does_not_end_is_cut() {
        let mut table = TableReader::new(&b"a,b\n1,2\n3,4\n5"[..]).unwrap();
        assert_eq!(rows(&mut table).len(), 2);
        assert_eq!(table.cut(), Some(4));
        // A whole one may lack the end of its line.
        let mut table = TableReader::new(&b"a,b\n1,2\n3,4"[..]).unwrap();
        assert_eq!((rows(&mut table).len(), table.cut()), (2, None));
    }

    #[test]
    fn a_line_sep_says_what_separates() {
        for (text, expected) in [
            ("sep=\t\na,b\tc\n", "a,b"),
            ("\"sep=;\"\r\na,b;c\r\n", "a,b"),
            ("SEP=,\na;b,c\n", "a;b"),
        ] {
            let table = TableReader::new(text.as_bytes()).unwrap();
            assert_eq!(table.header(), [expected, "c"], "{text:?}");
        }
    }

    #[test]
    fn semicolons_and_tabs_separate_where_the_heading_has_no_comma() {
        for text in ["a;b\n1;2,5", "a\tb\n1\t2,5", "a,b\n1,\"2,5\""] {
            let mut table = TableReader::new(text.as_bytes()).unwrap();
            assert_eq!(table.header(), ["a", "b"]);
            let row = table.next_row().unwrap().unwrap();
            assert_eq!((number(&row.field(0)), &*row.field(1)), (Some(1.0), "2,5"));
            let text = row.field(1).into_owned();
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
