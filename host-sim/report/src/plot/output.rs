//! A drawn figure as a document: SVG or PNG.
//!
//! The drawing library knows whole units only, so figures are laid out in units finer than a point of the page:
//! the SVG scales them back, and the PNG takes the mean of 2 x 2 units for a pixel, which smooths its edges.

use super::page::{Page, UNIT};
use super::{Figure, PlotError};
use plotters::prelude::{BitMapBackend, IntoDrawingArea, SVGBackend};

/// Units in a pixel of the PNG, along each axis.
const UNITS_IN_PIXEL: usize = 2;

/// On bitmaps the drawing library centres a text's box with the room for accents, so letters sit too high.
const BITMAP_TEXT_DROP: i32 = 3;

pub(super) fn svg(figure: &Figure) -> Result<String, PlotError> {
    let page = Page::new(figure)?;
    let (width, height) = page.units();
    let mut document = String::new();
    page.draw(&SVGBackend::with_string(&mut document, (width, height)).into_drawing_area())
        .map_err(|e| figure.failed(&e))?;
    // The view box stays in units; the size is in points.
    let points = |units: u32| units / UNIT as u32;
    let in_units = format!("<svg width=\"{width}\" height=\"{height}\"");
    let in_points = format!("<svg width=\"{}\" height=\"{}\"", points(width), points(height));
    Ok(document.replacen(&in_units, &in_points, 1))
}

pub(super) fn png(figure: &Figure) -> Result<Vec<u8>, PlotError> {
    let page = Page {
        text_drop: BITMAP_TEXT_DROP * UNIT,
        ..Page::new(figure)?
    };
    let (width, height) = page.units();
    let mut units = vec![0; 3 * width as usize * height as usize];
    page.draw(&BitMapBackend::with_buffer(&mut units, (width, height)).into_drawing_area())
        .map_err(|e| figure.failed(&e))?;
    let (width, height) = (width as usize / UNITS_IN_PIXEL, height as usize / UNITS_IN_PIXEL);
    let pixels = mean_of_units(&units, width, height);
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder
        .write_header()
        .and_then(|mut w| w.write_image_data(&pixels))
        .map_err(|e| figure.failed(&e))?;
    Ok(file)
}

fn mean_of_units(units: &[u8], width: usize, height: usize) -> Vec<u8> {
    let row = 3 * width * UNITS_IN_PIXEL;
    let mut pixels = Vec::with_capacity(3 * width * height);
    for y in 0..height {
        for x in 0..width {
            for channel in 0..3 {
                let unit = |i: usize, j: usize| {
                    u16::from(units[(UNITS_IN_PIXEL * y + j) * row + 3 * (UNITS_IN_PIXEL * x + i) + channel])
                };
                pixels.push(((unit(0, 0) + unit(1, 0) + unit(0, 1) + unit(1, 1) + 2) / 4) as u8);
            }
        }
    }
    pixels
}

impl Figure {
    fn failed(&self, cause: &dyn std::error::Error) -> PlotError {
        PlotError(format!("figure '{}' cannot be drawn: {cause}", self.title))
    }
}
