//! Pictures of the command.

use anyhow::Context;
use chart::{Axis, COLORS, Chart, Mark, Series};
use image::{Rgb, RgbImage};
use materials::{Model, Spectra};
use messages::{MaterialId, MaterialRow};
use pictures::bands::source::Region;
use pictures::material_color::material_color;
use std::path::Path;

/// Least share of the pixels of a material whose spectrum is drawn.
const MIN_SHARE: f64 = 0.02;
/// Color of the frame of a region.
const FRAME: Rgb<u8> = Rgb([255, 255, 255]);

/// A color for the material of each pixel, and the frames of the regions.
pub fn materials(size: [usize; 2], rows: &[MaterialRow], regions: &[Region], path: &Path) -> anyhow::Result<()> {
    let [columns, height] = size;
    let pixel = |x: u32, y: u32| Rgb(material_color(rows[y as usize * columns + x as usize].material_id));
    let mut picture = RgbImage::from_fn(columns as u32, height as u32, pixel);
    for region in regions {
        let [x, y, w, h] = *region;
        for i in cells(size, *region) {
            let at = [i % columns, i / columns];
            if at[0] == x || at[1] == y || at[0] + 1 == x + w || at[1] + 1 == y + h {
                picture.put_pixel(at[0] as u32, at[1] as u32, FRAME);
            }
        }
    }
    picture.save(path).with_context(|| path.display().to_string())
}

/// The vegetation index from brown (0 and below) to green (1); black where it is unknown.
pub fn index(size: [usize; 2], index: &[Option<f32>], path: &Path) -> anyhow::Result<()> {
    let pixel = |x: u32, y: u32| {
        let Some(index) = index[y as usize * size[0] + x as usize] else { return Rgb([0; 3]) };
        let share = index.clamp(0.0, 1.0);
        let mix = |low: f32, high: f32| (low + (high - low) * share) as u8;
        Rgb([mix(140.0, 0.0), mix(90.0, 200.0), mix(50.0, 40.0)])
    };
    RgbImage::from_fn(size[0] as u32, size[1] as u32, pixel).save(path).with_context(|| path.display().to_string())
}

/// Cells of a region that are inside the image.
pub fn cells([columns, rows]: [usize; 2], [x, y, w, h]: Region) -> Vec<usize> {
    let inside = |first: usize, n: usize, end: usize| first.min(end)..first.saturating_add(n).min(end);
    inside(y, h, rows).flat_map(|row| inside(x, w, columns).map(move |column| row * columns + column)).collect()
}

/// Mean spectra of the regions, or of the materials, as lines with dots, and the nearest reference of each as a thin line. Spectra are
/// divided by their mean: brightness depends on light and shadow.
pub fn spectra(model: &Model, spectra: &Spectra, rows: &[MaterialRow], size: [usize; 2], regions: &[Region]) -> Chart {
    let groups: Vec<(String, Vec<usize>)> = if regions.is_empty() {
        let of = |id: &MaterialId| {
            let pixels: Vec<usize> = (0..rows.len()).filter(|i| rows[*i].material_id == *id as u8).collect();
            (id.name().to_owned(), pixels)
        };
        let is_large = |(_, pixels): &(String, Vec<usize>)| pixels.len() as f64 >= MIN_SHARE * rows.len() as f64;
        MaterialId::ALL.iter().map(of).filter(is_large).collect()
    } else {
        let of = |region: &Region| (format!("{region:?}"), cells(size, *region));
        regions.iter().map(of).collect()
    };
    let mut order: Vec<usize> = (0..spectra.wavelengths_nm.len()).collect();
    order.sort_by(|a, b| spectra.wavelengths_nm[*a].total_cmp(&spectra.wavelengths_nm[*b]));
    let mut lines = Vec::new();
    for (number, (name, pixels)) in groups.iter().enumerate() {
        let color = COLORS[number % COLORS.len()];
        let measured = normalized(order.iter().filter_map(|band| {
            let values = pixels.iter().filter(|i| spectra.valid[**i] >> band & 1 == 1);
            let values: Vec<f64> = values.map(|i| f64::from(spectra.get(*i).values[*band])).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            (!values.is_empty()).then_some([f64::from(spectra.wavelengths_nm[*band]), mean])
        }));
        if let Some(NearestReference { reference, points, .. }) = nearest(model, &measured) {
            let reference = format!("{} ({})", model.references[reference].name, model.references[reference].material);
            lines.push(Series::thin_line(reference, color, points));
        }
        lines.push(Series::dots(name.clone(), color, measured.clone()));
        lines.push(Series { name: name.clone(), color, mark: Mark::Line { points: measured, width: 2.2 } });
    }
    let points = || lines.iter().flat_map(Series::points);
    let low = points().map(|point| point[0]).fold(f64::INFINITY, f64::min);
    let high = points().map(|point| point[0]).fold(0.0, f64::max);
    let top = points().map(|point| point[1]).fold(1.0, f64::max);
    let x = Axis::new("wavelength, nm", [low.min(high), high]);
    let y = Axis::new("spectrum / its mean", [0.0, top * 1.02]);
    Chart::new("Mean spectra, and the nearest references (thin)", x, y, lines)
}

/// Values divided by their mean.
fn normalized(points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let points: Vec<[f64; 2]> = points.collect();
    let mean = points.iter().map(|point| point[1]).sum::<f64>() / points.len().max(1) as f64;
    points.into_iter().map(|[nm, value]| [nm, value / mean.max(1e-9)]).collect()
}

/// A reference near a measured spectrum.
struct NearestReference {
    /// Sum of the squared differences.
    off: f64,
    /// Its index.
    reference: usize,
    /// Wavelengths and normalized values.
    points: Vec<[f64; 2]>,
}

/// The reference with the smallest squared difference, at the same wavelengths.
fn nearest(model: &Model, measured: &[[f64; 2]]) -> Option<NearestReference> {
    let of_reference = |reference: usize| {
        let at = |[nm, measured]: &[f64; 2]| Some(([*nm, model.reflectance(reference, *nm as f32)?], *measured));
        let (points, measured): (Vec<[f64; 2]>, Vec<f64>) = measured.iter().filter_map(at).unzip();
        let points = normalized(points.into_iter());
        let off: f64 = points.iter().zip(measured).map(|(point, measured)| (point[1] - measured).powi(2)).sum();
        NearestReference { off, reference, points }
    };
    let candidates = (0..model.references.len()).map(of_reference);
    candidates.min_by(|a, b| a.off.total_cmp(&b.off))
}
