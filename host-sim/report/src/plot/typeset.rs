//! Words of a figure as a paper sets them: subscripts, and dots between units.

/// How far below the line a subscript stands, points.
const DROP: f64 = 3.0;
/// Longest subscript: of `t_nms`, and one more.
const LONGEST: usize = 4;

/// A unit with dots at half height, as in N·m.
pub(crate) fn units(label: &str) -> String {
    label
        .replace("N.m", "N\u{b7}m")
        .replace("(m.s)", "(m\u{b7}s)")
        .replace("kg.m2", "kg\u{b7}m\u{b2}")
}

/// An SVG whose texts have their symbols with subscripts.
pub(super) fn texts(svg: &str) -> String {
    const END: &str = "</text>";
    let mut pieces = svg.split(END).peekable();
    let mut set = String::with_capacity(svg.len());
    while let Some(piece) = pieces.next() {
        let start = piece.rfind('>').map_or(0, |end| end + 1);
        if pieces.peek().is_none() {
            set.push_str(piece);
            break;
        }
        set.push_str(&piece[..start]);
        set.push_str(&symbols(&units(&piece[start..])));
        set.push_str(END);
    }
    set
}

/// A text in which what stands below the line is a `tspan`.
fn symbols(text: &str) -> String {
    let is_in_word = |c: char| c.is_alphanumeric() || c == '_' || c == '-';
    let mut set = String::new();
    let mut rest = text;
    while !rest.is_empty() {
        let length = |inside: bool| rest.find(|c| is_in_word(c) != inside).unwrap_or(rest.len());
        let (word, behind) = rest.split_at(length(true));
        rest = behind;
        match subscripted(word) {
            Some((base, below)) => {
                set.push_str(&format!(
                    "{base}<tspan dy=\"{DROP}\" font-size=\"75%\">{below}</tspan>"
                ));
                if !rest.is_empty() {
                    // Back to the line; what follows is set by itself.
                    return format!("{set}<tspan dy=\"-{DROP}\">{}</tspan>", symbols(rest));
                }
            }
            None => set.push_str(word),
        }
        let (between, behind) = rest.split_at(rest.find(is_in_word).unwrap_or(rest.len()));
        set.push_str(between);
        rest = behind;
    }
    set
}

/// A symbol, such as `K_hg` or `gain_1`, and what stands below its line. Names of files and columns are longer words.
fn subscripted(word: &str) -> Option<(&str, &str)> {
    let (base, below) = word.split_once('_')?;
    let is_symbol = base == "gain" || (base.len() == 1 && base.is_ascii());
    let is_short = (1..=LONGEST).contains(&below.len()) && below.chars().all(|c| c.is_ascii_alphanumeric());
    (is_symbol && is_short && base.chars().all(char::is_alphabetic)).then_some((base, below))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn symbols_have_subscripts_and_names_of_columns_stay() {
        let below = |name: &str| format!("<tspan dy=\"3\" font-size=\"75%\">{name}</tspan>");
        assert_eq!(symbols("t_p"), format!("t{}", below("p")));
        assert_eq!(
            symbols("K_hg (-)"),
            format!("K{}<tspan dy=\"-3\"> (-)</tspan>", below("hg"))
        );
        for name in [
            "driver_torque_nm",
            "guided-probe_1",
            "a_b_c",
            "t_",
            "_p",
            "running_wide",
            "",
            "x t_nominal",
        ] {
            assert_eq!(symbols(name), name);
        }
    }

    #[test]
    fn only_texts_are_set() {
        let svg = "<g id=\"t_p\"><text x=\"1\">Torque (N.m)</text><path d=\"M1\"/><text>gain_1 &amp; N.m/(m.s)</text></g>";
        let set = texts(svg);
        assert!(set.starts_with("<g id=\"t_p\"><text x=\"1\">Torque (N\u{b7}m)</text><path d=\"M1\"/>"));
        assert!(set.contains(">gain<tspan dy=\"3\" font-size=\"75%\">1</tspan>"));
        assert!(
            set.ends_with(" &amp; N\u{b7}m/(m\u{b7}s)</tspan></text></g>"),
            "{set}"
        );
        assert_eq!(units("kg.m2"), "kg\u{b7}m\u{b2}");
    }
}
