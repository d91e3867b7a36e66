//! A picture like figure 3.9 of the thesis: pixels, tree and lines in the spectral space.

use super::frame::Frame;
use chart::{Axis, COLORS, Chart, Mark, Series};
use color_lines::Model;

/// Largest number of pixels shown: more would hide each other.
const MAX_DOTS: usize = 1500;
/// Side of a plot area, px.
const SIDE: f64 = 360.0;

/// The spectral space in three planes of its longest, middle and shortest wavelengths, or of red, green and blue.
pub fn spectrum(frame: &Frame, model: &Model, n_lines: usize) -> String {
    let bands = &frame.bands;
    let mut order: Vec<usize> = (0..bands.n_bands).collect();
    // Red, the longest wavelength, is the first band of a color image.
    order.sort_by(|a, b| {
        let wavelength = |band: &usize| bands.wavelengths_nm.get(*band).copied().unwrap_or_default();
        wavelength(b).total_cmp(&wavelength(a)).then(a.cmp(b))
    });
    let [first, middle, last] = [order[0], order[order.len() / 2], order[order.len() - 1]];
    let plane = |x: usize, y: usize| plane(frame, model, n_lines, [x, y]);
    chart::sheet(&[plane(first, middle), plane(middle, last), plane(first, last)], 3)
}

fn plane(frame: &Frame, model: &Model, n_lines: usize, bands: [usize; 2]) -> Chart {
    let [columns, rows] = frame.bands.size;
    let n_pixels = columns * rows;
    let value = |pixel: usize, band: usize| f64::from(frame.bands.values[band * n_pixels + pixel]);
    let node = |node: usize| match node {
        0 => [0.0; 2],
        _ => bands.map(|band| model.regions[node - 1].spectrum[band]),
    };
    // A step that shares no factor with the width does not follow columns.
    let step = (n_pixels / MAX_DOTS).max(1) | 1;
    let dots: Vec<[f64; 2]> = (0..n_pixels).step_by(step).map(|pixel| bands.map(|band| value(pixel, band))).collect();
    let largest = dots.iter().flatten().copied().filter(|value| value.is_finite()).fold(0.0, f64::max);
    let mut series = vec![Series {
        name: "pixels".to_owned(),
        color: "#c8c8c8",
        mark: Mark::Dots {
            points: dots.into_iter().filter(|dot| dot.iter().all(|v| v.is_finite())).collect(),
            radius: 1.2,
        },
    }];
    if let Some(tree) = &model.tree {
        let edges = tree.toward_origin.iter().zip(1..);
        series
            .extend(edges.map(|((next, _), from)| Series::thin_line("tree", COLORS[5], vec![node(*next), node(from)])));
    } else {
        let means = (1..=model.regions.len()).map(node).collect();
        series.push(Series::dots("means of the regions", COLORS[0], means));
    }
    for (number, line) in model.lines.iter().take(n_lines).enumerate() {
        let points: Vec<[f64; 2]> = line.nodes.iter().map(|index| node(*index)).collect();
        let name = format!("line {}", number + 1);
        let color = COLORS[number % 5];
        series.push(Series::dots(name.clone(), color, points.clone()));
        series.push(Series { name, color, mark: Mark::Line { points, width: 2.4 } });
    }
    let axis = |band: usize| Axis::new(name(frame, band), [0.0, largest * 1.02]);
    let x = axis(bands[0]);
    let y = axis(bands[1]);
    Chart { size: [SIDE, SIDE], ..Chart::new("", x, y, series) }
}

/// Name of a band on an axis.
fn name(frame: &Frame, band: usize) -> String {
    match frame.bands.wavelengths_nm.get(band) {
        Some(nm) => format!("{nm:.0} nm"),
        None if frame.bands.n_bands == 3 => ["red", "green", "blue"][band].to_owned(),
        None => format!("band {}", band + 1),
    }
}
