//! `replica-lab fit-materials`: fits the model of the materials.

use super::library::{Library, SurfaceKind};
use super::{TownArgs, is_held_out, library};
use anyhow::Context;
use command_line::{say, say_error};
use materials::{Fit, Model, Spectra};
use messages::MaterialId;
use std::path::PathBuf;
use std::process::ExitCode;
use town::Material;

/// Fit the model that assigns materials to points.
///
/// Measures the spectra of simulated drives and adds the spectra of libraries. Every third surface of the towns is left out; `replica-lab
/// evaluate materials` also scores these surfaces. The model is compiled into the program, from models/materials.json.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
                  Example: replica-lab fit-materials --seeds 101,102 --out materials.json")]
pub struct Args {
    #[command(flatten)]
    towns: TownArgs,
    /// Spectral libraries (ENVI .hdr or .sli, ECOSTRESS .txt)
    #[arg(long, value_name = "LIBRARY", num_args = 1..)]
    library: Vec<PathBuf>,
    /// File for the model
    #[arg(long, value_name = "JSON")]
    out: PathBuf,
}

/// A fit with ascending bands.
struct SortedFit {
    /// The bands of the simulation, ascending.
    order: Vec<usize>,
    fit: Fit,
    wavelengths_nm: Vec<f32>,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let mut found: Option<SortedFit> = None;
    args.towns.for_each(false, |town| {
        let SortedFit { order, fit, .. } = found.get_or_insert_with(|| {
            let nm = &town.spectra.wavelengths_nm;
            let mut order: Vec<usize> = (0..nm.len()).collect();
            order.sort_by(|a, b| nm[*a].total_cmp(&nm[*b]));
            let sorted: Vec<f32> = order.iter().map(|band| nm[*band]).collect();
            let mut fit = Fit::new(&sorted);
            for surface in Material::ALL.iter().filter(|surface| !is_held_out(**surface)) {
                let Some(material) = surface.id() else { continue };
                let spectrum = surface.spectrum();
                let reflectances: Vec<f32> = sorted.iter().map(|nm| spectrum.at(*nm)).collect();
                fit.add_surface(&format!("{surface:?}"), material, &reflectances);
            }
            SortedFit { order, fit, wavelengths_nm: sorted }
        });
        let spectra = sorted(&town.spectra, order);
        for (i, surface) in town.surfaces.iter().enumerate() {
            if let Some(surface) = surface.filter(|surface| !is_held_out(surface.material)) {
                fit.add(&format!("{:?}", surface.material), surface.is_sunlit, spectra.get(i));
            }
        }
        Ok(())
    })?;
    let SortedFit { mut fit, wavelengths_nm, .. } = found.context("no submap was simulated")?;
    for path in &args.library {
        let Library { known, others } = library::read(path, &wavelengths_nm)?;
        for SurfaceKind { name, material, reflectances } in &known {
            fit.add_surface(name, *material, reflectances);
        }
        say_error!("{}: {} kinds; without a material: {}", path.display(), known.len(), others.join(", "));
    }
    let libraries: Vec<String> =
        args.library.iter().filter_map(|path| Some(path.file_stem()?.to_string_lossy().into_owned())).collect();
    let libraries = if libraries.is_empty() { String::new() } else { format!("; {}", libraries.join(", ")) };
    let about = format!("{}{libraries}", args.towns.description());
    let model = fit.model(about).context("too few spectra: a surface in the sun and one in the shade need 20")?;
    std::fs::write(&args.out, model.to_json()).with_context(|| args.out.display().to_string())?;
    print(&model)?;
    Ok(ExitCode::SUCCESS)
}

/// The spectra with ascending bands.
fn sorted(spectra: &Spectra, order: &[usize]) -> Spectra {
    let nm: Vec<f32> = order.iter().map(|band| spectra.wavelengths_nm[*band]).collect();
    let mut sorted = Spectra::new(&nm);
    for i in 0..spectra.len() {
        let spectrum = spectra.get(i);
        let values: Vec<f32> = order.iter().map(|band| spectrum.values[*band]).collect();
        let bit = |(to, from): (usize, &usize)| (spectrum.valid >> from & 1) << to;
        sorted.push(order.iter().enumerate().map(bit).fold(0, |bits, bit| bits | bit), &values);
    }
    sorted
}

fn print(model: &Model) -> anyhow::Result<()> {
    say!("{} references, largest distance {}", model.references.len(), model.max_distance)?;
    say!("| material | references |\n|---|---|")?;
    for material in MaterialId::ALL.iter().skip(1) {
        let of = model.references.iter().filter(|reference| reference.material == material.name());
        let names: Vec<&str> = of.map(|reference| reference.name.as_str()).collect();
        say!("| {} | {} |", material.name(), names.join(", "))?;
    }
    Ok(())
}
