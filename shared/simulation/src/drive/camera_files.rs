//! Color images, mosaic images with references and calibration, and ground truth of materials and defective pixels.

use super::files::Folder;
use super::progress::{MOSAIC_WORK, Progress, image_work};
use crate::error::SimulationError;
use crate::sensors::camera::ColorCamera;
use crate::sensors::mosaic::{BIT_DEPTH, Chip, DefectivePixel, MosaicCamera, SIZE, sensor_calibration};
use crate::simulation::{MOSAIC_STREAM, Simulation};
use formats::pgm::pgm_from_samples;
use geometry::Stamp;
use random::hash;
use std::fmt::Write;
use town::material::Material;

/// Number of images of each reference.
const N_REFERENCES: u64 = 2;
/// Writes the images of the color cameras; returns their number.
pub fn write_images(
    simulation: &Simulation,
    folder: &Folder,
    exposures: &[Stamp],
    progress: &mut Progress<'_>,
) -> Result<u32, SimulationError> {
    let mut n_images = 0;
    for group in simulation.rig.lens_groups() {
        let lens = &simulation.rig.cameras[group[0]].lens;
        let camera = ColorCamera::new(lens);
        for stamp in exposures {
            for (index, pixels) in group.iter().zip(simulation.images(&camera, &group, *stamp)) {
                folder.write_jpeg(&format!("camera/{index}/{}.jpg", stamp.0), &pixels, camera.size())?;
                progress.add(image_work(lens));
                n_images += 1;
            }
        }
    }
    Ok(n_images)
}

/// Writes raw images, references and calibration files of the mosaic cameras; returns the number of images.
pub fn write_mosaics(
    simulation: &Simulation,
    folder: &Folder,
    exposures: &[Stamp],
    progress: &mut Progress<'_>,
) -> Result<u32, SimulationError> {
    let mut defects = "camera,u,v,fault\n".to_owned();
    for (index, mosaic) in simulation.rig.mosaics.iter().enumerate() {
        let name = &mosaic.name;
        let model = mosaic.sensor.clone();
        folder.write(&format!("{name}/sensor.xml"), sensor_calibration(&model).to_xml().as_bytes())?;
        for DefectivePixel { u, v, defect: fault } in Chip::new(model.sensor_id).defects() {
            let _ = writeln!(defects, "{name},{u},{v},{fault:?}");
        }
        let camera = MosaicCamera::new(model, &mosaic.lens).exposed(simulation.spec.mosaic_exposure_nanos);
        let write = |path: String, samples: Vec<u16>| {
            folder.write(&path, &pgm_from_samples(SIZE[0] as u32, SIZE[1] as u32, (1 << BIT_DEPTH) - 1, &samples))
        };
        let seed = hash(simulation.spec.seed, MOSAIC_STREAM ^ (index as u64 + 1) << 8);
        for k in 0..N_REFERENCES {
            write(format!("{name}/dark/{k}.pgm"), camera.dark(hash(seed, 2 * k + 1)))?;
            write(format!("{name}/white/{k}.pgm"), camera.white(hash(seed, 2 * k + 2)))?;
        }
        for stamp in exposures {
            write(format!("{name}/{}.pgm", stamp.0), simulation.mosaic(&camera, index, *stamp))?;
            progress.add(MOSAIC_WORK);
        }
    }
    folder.write("truth/dead_pixels.csv", defects.as_bytes())?;
    Ok((exposures.len() * simulation.rig.mosaics.len()) as u32)
}

/// Writes the reflectance of every material: one column per material, one row per 10 nm.
pub fn write_materials(folder: &Folder) -> Result<(), SimulationError> {
    let mut table = "wavelength_nm".to_owned();
    let spectra: Vec<Vec<(f32, f32)>> = Material::ALL.iter().map(|m| m.spectrum().samples().collect()).collect();
    for material in Material::ALL {
        let _ = write!(table, ",{material:?}");
    }
    table.push('\n');
    for (i, (nm, _)) in spectra[0].iter().enumerate() {
        let _ = write!(table, "{nm}");
        for spectrum in &spectra {
            let _ = write!(table, ",{:.4}", spectrum[i].1);
        }
        table.push('\n');
    }
    folder.write("truth/materials.csv", table.as_bytes())
}
