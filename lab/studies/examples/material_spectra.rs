//! Draws the reflectance spectra of materials: `material_spectra OUT.svg [MATERIAL ...]`, by default six that differ most.

use chart::{Axis, Chart, Mark, Series};
use std::error::Error;
use town::material::Material;

/// Highest reflectance on the plot.
const TOP: f64 = 0.8;
/// A little like the materials.
const COLORS: [&str; 8] = ["#2e7d32", "#c0392b", "#555555", "#c8a060", "#2060c0", "#b07020", "#803090", "#108080"];

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let out = arguments.next().ok_or("usage: material_spectra OUT.svg [MATERIAL ...]")?;
    let names: Vec<String> = arguments.collect();
    let materials = if names.is_empty() {
        use Material::{Asphalt, Brick, Leaves, LimestoneDressed, SignBlue, SkinLight};
        vec![Leaves, Brick, Asphalt, LimestoneDressed, SignBlue, SkinLight]
    } else {
        names.iter().map(|name| by_name(name)).collect::<Result<_, _>>()?
    };
    std::fs::write(out, plot(&materials))?;
    Ok(())
}

fn by_name(name: &str) -> Result<Material, String> {
    let known = Material::ALL.iter().copied();
    known.clone().find(|material| format!("{material:?}") == name).ok_or_else(|| {
        let names: Vec<String> = known.map(|material| format!("{material:?}")).collect();
        format!("{name}: no such material; there are {}", names.join(", "))
    })
}

fn plot(materials: &[Material]) -> String {
    let line = |(i, material): (usize, &Material)| {
        let spectrum = material.spectrum();
        let points = (0..=60).map(|step| 400.0 + 10.0 * step as f32).map(|nm| [nm.into(), spectrum.at(nm).into()]);
        Series {
            mark: Mark::Line { points: points.collect(), width: 2.0 },
            ..Series::line(format!("{material:?}"), COLORS[i % COLORS.len()], Vec::new())
        }
    };
    let lines = materials.iter().enumerate().map(line).collect();
    let x = Axis::new("wavelength, nm", [400.0, 1000.0]);
    let y = Axis::new("reflectance", [0.0, TOP]);
    Chart::new("", x, y, lines).svg()
}
