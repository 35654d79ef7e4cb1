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

#[test]
fn digits_beyond_all_numbers_are_none() {
    for (text, value) in [
        ("1e308", 1e308),
        ("-1e-400", 0.0),
        ("inf", f64::INFINITY),
        ("-inf", f64::NEG_INFINITY),
    ] {
        assert_eq!(number(text), Some(value), "{text}");
    }
    for text in ["1e400", "-1e309", &"9".repeat(400)] {
        assert_eq!(number(text), None, "{text}");
        let (line, column, text) = (3, "a".into(), text.into());
        let error = TableError::NotANumber { line, column, text }.to_string();
        assert!(
            error.ends_with("which is not a number: the largest is 1.8e308"),
            "{error}"
        );
    }
}
