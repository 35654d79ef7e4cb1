//! The built-in font: the Latin and Greek part of DejaVu Sans (licence beside it in `assets`).
//!
//! Made from DejaVu 2.35 with fonttools: `pyftsubset --no-hinting --layout-features= --unicodes=` U+0020-007E,
//! U+00A0-017F, U+0391-03C9, U+2010-2015, U+2018-201D, U+2026, U+2032-2033, U+2080-2089, U+2190-2193, U+2206,
//! U+2212, U+2248, U+2260, U+2264-2265.
//!
//! Registered as "sans-serif": a browser that shows the SVG takes its own sans-serif, whose letters are about
//! as wide or narrower.

use plotters::style::{FontFamily, FontStyle, register_font};
use std::sync::Once;

const REGULAR: &[u8] = include_bytes!("../../assets/DejaVuSans-latin.ttf");
const BOLD: &[u8] = include_bytes!("../../assets/DejaVuSans-Bold-latin.ttf");

/// Makes the font known to the drawing library; any number of calls.
pub(super) fn register() -> FontFamily<'static> {
    static ONCE: Once = Once::new();
    let family = FontFamily::SansSerif;
    ONCE.call_once(|| {
        for (style, bytes) in [(FontStyle::Normal, REGULAR), (FontStyle::Bold, BOLD)] {
            let registered = register_font(family.as_str(), style, bytes);
            assert!(registered.is_ok(), "the built-in font is a font");
        }
    });
    family
}
