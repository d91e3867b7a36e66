//! Draws the reflectance spectra of materials: `material_spectra OUT.svg [MATERIAL ...]`, by default six that differ most.

use simulation::material::Material;
use std::error::Error;
use std::fmt::Write as _;

/// Of the plot's frame, px.
const SIZE: [f32; 2] = [640.0, 360.0];
const MARGIN: f32 = 50.0;
/// Highest reflectance on the plot.
const TOP: f32 = 0.8;
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
    std::fs::write(out, plot(&materials)?)?;
    Ok(())
}

fn by_name(name: &str) -> Result<Material, String> {
    let known = Material::ALL.iter().copied();
    known.clone().find(|material| format!("{material:?}") == name).ok_or_else(|| {
        let names: Vec<String> = known.map(|material| format!("{material:?}")).collect();
        format!("{name}: no such material; there are {}", names.join(", "))
    })
}

fn plot(materials: &[Material]) -> Result<String, std::fmt::Error> {
    let [width, height] = SIZE.map(|side| side + 2.0 * MARGIN);
    let x = |nm: f32| MARGIN + SIZE[0] * (nm - 400.0) / 600.0;
    let y = |reflectance: f32| MARGIN + SIZE[1] * (1.0 - reflectance / TOP);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\" \
         font-size=\"13\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    for step in 0..=6 {
        let nm = 400.0 + 100.0 * step as f32;
        writeln!(svg, "<path d=\"M{0} {1}V{2}\" stroke=\"#ddd\"/>", x(nm), y(0.0), y(TOP))?;
        writeln!(svg, "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{nm}</text>", x(nm), y(0.0) + 18.0)?;
    }
    for step in 0..=4 {
        let reflectance = 0.2 * step as f32;
        writeln!(svg, "<path d=\"M{0} {2}H{1}\" stroke=\"#ddd\"/>", x(400.0), x(1000.0), y(reflectance))?;
        writeln!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{reflectance:.1}</text>",
            x(400.0) - 6.0,
            y(reflectance) + 4.0
        )?;
    }
    writeln!(svg, "<text x=\"{}\" y=\"{}\">reflectance</text>", 8.0, MARGIN - 16.0)?;
    writeln!(svg, "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">wavelength, nm</text>", x(1000.0), y(0.0) + 36.0)?;
    for (i, material) in materials.iter().enumerate() {
        let (spectrum, color) = (material.spectrum(), COLORS[i % COLORS.len()]);
        let points: Vec<String> = (0..=60)
            .map(|step| 400.0 + 10.0 * step as f32)
            .map(|nm| format!("{:.1},{:.1}", x(nm), y(spectrum.at(nm))))
            .collect();
        writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\"/>",
            points.join(" ")
        )?;
        let line = MARGIN + 14.0 + 17.0 * i as f32;
        writeln!(
            svg,
            "<path d=\"M{0} {2}H{1}\" stroke=\"{color}\" stroke-width=\"3\"/>",
            x(410.0),
            x(430.0),
            line - 4.0
        )?;
        writeln!(svg, "<text x=\"{}\" y=\"{line}\">{material:?}</text>", x(436.0))?;
    }
    svg.push_str("</svg>\n");
    Ok(svg)
}
