//! What is meant by a name that is none of those that are known.

/// How alike two names are, 0 to 1, that one of them may be the other mistyped.
const ALIKE: f64 = 0.75;

/// Behind a name that is none of those that are known: `; did you mean NAME?` if one is like it, else nothing.
#[must_use]
pub fn did_you_mean<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let lower = name.to_lowercase();
    let alike = known.into_iter();
    let alike = alike.map(|known| (known, strsim::jaro_winkler(&lower, known)));
    match alike.max_by(|a, b| a.1.total_cmp(&b.1)) {
        Some((near, alike)) if alike >= ALIKE => format!("; did you mean {near}?"),
        _ => String::new(),
    }
}
