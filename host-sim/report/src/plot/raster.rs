//! The SVG as pixels.
//!
//! The font is the Latin and Greek part of DejaVu Sans (licence beside it in `assets`), made from DejaVu 2.35 with
//! fonttools: `pyftsubset --no-hinting --layout-features= --unicodes=` U+0020-007E, U+00A0-017F, U+0391-03C9,
//! U+2010-2015, U+2018-201D, U+2026, U+2032-2033, U+2080-2089, U+2190-2193, U+2206, U+2212, U+2248, U+2260,
//! U+2264-2265. It is given to the rasteriser as bytes; no font of the system is looked for. A browser that shows
//! the SVG takes its own sans-serif, whose letters are about as wide.

use std::sync::{Arc, OnceLock};

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree, fontdb::Database};

const REGULAR: &[u8] = include_bytes!("../../assets/DejaVuSans-latin.ttf");
const BOLD: &[u8] = include_bytes!("../../assets/DejaVuSans-Bold-latin.ttf");
const FAMILY: &str = "DejaVu Sans";

/// Pixels in a point of the page, along each axis.
const PIXELS_IN_POINT: f32 = 2.0;

pub(super) fn png(svg: &str) -> Result<Vec<u8>, Box<dyn std::error::Error>> {
    Ok(pixels(svg)?.encode_png()?)
}

pub(super) fn pixels(svg: &str) -> Result<Pixmap, Box<dyn std::error::Error>> {
    let options = Options {
        font_family: FAMILY.into(),
        fontdb: fonts(),
        ..Options::default()
    };
    let tree = Tree::from_str(svg, &options)?;
    let size = |points: f32| (points * PIXELS_IN_POINT).ceil() as u32;
    let mut pixels =
        Pixmap::new(size(tree.size().width()), size(tree.size().height())).ok_or("a page without area")?;
    let scale = Transform::from_scale(PIXELS_IN_POINT, PIXELS_IN_POINT);
    resvg::render(&tree, scale, &mut pixels.as_mut());
    Ok(pixels)
}

fn fonts() -> Arc<Database> {
    static FONTS: OnceLock<Arc<Database>> = OnceLock::new();
    let load = || {
        let mut fonts = Database::new();
        fonts.load_font_data(REGULAR.to_vec());
        fonts.load_font_data(BOLD.to_vec());
        fonts.set_sans_serif_family(FAMILY);
        Arc::new(fonts)
    };
    FONTS.get_or_init(load).clone()
}
