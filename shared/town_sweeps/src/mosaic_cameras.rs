//! Measurements of the mosaic cameras at the points of a submap: raw frames with noise, motion blur and defective pixels,
//! calibrated by dark and white references, and sampled at the points like in the stage `colorize`.

use crate::error::TownSweepsError;
use color_lines::{CubeRegions, CubeSettings};
use coloring::{AgeLimits, Bands, CameraCubes, CubeImage, PointBuffers, ProjectionCamera, SpectraColumn, SubmapPoints};
use geometry::{RigCamera, Stamp};
use messages::pod::cast_slice_mut;
use messages::{CubeHeader, MAX_CUBE_BANDS, SpectraHeader, SubmapHeader, SubmapPoint};
use simulation::Simulation;
use simulation::sensors::mosaic::{
    BIT_DEPTH, EXPOSURE_NANOS, MosaicCamera, SIZE, WHITE_EXPOSURE_NANOS, WHITE_REFLECTANCE, sensor_calibration,
};
use spectral::{Calibration, Camera, Mosaic, Reference, SpectralError, WhiteTarget, median_3x3};

/// Default limits of `colorize`.
const LIMITS: AgeLimits = AgeLimits { max_age_s: 1.0, max_moving_age_s: 0.1 };

/// Measurements of the mosaic cameras at the points of a submap.
pub struct PointSpectra {
    /// Header of the topic `spectra`.
    pub header: Box<SpectraHeader>,
    /// Its rows.
    pub rows: Vec<u32>,
    /// Rows of the topic `region`: 0 without color lines.
    pub regions: Vec<u32>,
}

/// The mosaic cameras of a simulated vehicle.
pub struct MosaicCameras {
    cameras: Vec<CalibratedCamera>,
    bands: Bands,
    median: bool,
}

struct CalibratedCamera {
    sensor: MosaicCamera,
    spectral: Camera,
    projection: ProjectionCamera,
}

impl MosaicCameras {
    /// The cameras of a simulation, with their references. With `median`, cubes are smoothed as by the setting of
    /// `calibrate`.
    pub fn new(simulation: &Simulation, median: bool) -> Result<Self, TownSweepsError> {
        let cameras: Result<Vec<CalibratedCamera>, SpectralError> = (simulation.rig.mosaics.iter())
            .map(|spec| {
                let model = spec.sensor.clone();
                let calibration = sensor_calibration(&model);
                let filters_nm: Vec<f64> = model.bands().iter().map(|band| f64::from(band.center_nm)).collect();
                let area = model.active_area.map(|v| v as u32);
                let pattern = model.pattern as u32;
                let mosaic = Mosaic::new(SIZE.map(|v| v as u32), pattern, area, BIT_DEPTH)?;
                let sensor = MosaicCamera::new(model, &spec.lens);
                let reference = |what, frame: &[u16]| {
                    let mut reference = Reference::new(what, &mosaic);
                    reference.add(frame).map(|()| reference)
                };
                let dark = reference("dark", &sensor.dark(1))?;
                let white = reference("white", &sensor.white(2))?;
                let target =
                    WhiteTarget { reflectance: f64::from(WHITE_REFLECTANCE), exposure_nanos: WHITE_EXPOSURE_NANOS };
                let references = Calibration::new(&mosaic, &dark, &white, target)?;
                let spectral = Camera::new(references, &filters_nm, Some(&calibration))?;
                let projection = RigCamera { body_from_camera: spec.body_from_camera, model: spec.lens.clone() };
                Ok(CalibratedCamera { sensor, spectral, projection: ProjectionCamera::from(&projection) })
            })
            .collect();
        let cameras = cameras?;
        let wavelengths_nm: Vec<Vec<f32>> =
            cameras.iter().map(|camera| camera.spectral.wavelengths_nm().to_vec()).collect();
        let bands = Bands::new(&wavelengths_nm)?;
        Ok(Self { cameras, bands, median })
    }

    /// The topic `spectra` of a submap of the simulation, and its topic `region` with one model for all cubes of a camera.
    pub fn spectra(
        &self,
        simulation: &Simulation,
        header: &SubmapHeader,
        points: &[SubmapPoint],
        color_lines: Option<&CubeSettings>,
    ) -> Result<PointSpectra, TownSweepsError> {
        let sweeps = &header.sweeps[..header.n_sweeps as usize];
        let begin = sweeps.first().map_or(0, |sweep| sweep.stamp);
        let end = sweeps.last().map_or(0, |sweep| sweep.stamp + i64::from(sweep.duration_nanos));
        let age_nanos = (LIMITS.max_age_s * 1e9) as i64;
        let stamps = simulation.exposures();
        let stamps: Vec<Stamp> =
            stamps.into_iter().filter(|stamp| (begin - age_nanos..=end + age_nanos).contains(&stamp.0)).collect();
        let mut shot = Vec::new();
        let mut models = CubeRegions::default();
        for (index, camera) in self.cameras.iter().enumerate() {
            for stamp in &stamps {
                let raw = simulation.mosaic(&camera.sensor, index, *stamp);
                let (cube, mut rows) = camera.cube(index, &raw, self.median)?;
                if let Some(settings) = color_lines {
                    let n_cells = cube.width as usize * cube.height as usize;
                    rows.resize(rows.len() + n_cells, 0);
                    let (reflectances, rest) = rows.split_at_mut(cube.n_bands as usize * n_cells);
                    let (masks, regions) = rest.split_at_mut(n_cells);
                    models.divide(&cube, settings, cast_slice_mut(reflectances), masks, regions)?;
                }
                shot.push((index, *stamp, (cube, rows)));
            }
        }
        let world_from_submap = simulation.motion.pose_at(Stamp(begin));
        let mut cubes: Vec<CameraCubes<'_>> = Vec::new();
        cubes.resize_with(self.cameras.len(), CameraCubes::default);
        for (index, stamp, (cube, rows)) in &shot {
            let world_from_body = simulation.motion.pose_at(*stamp);
            let Some(image) = CubeImage::new(cube, rows) else { continue };
            let camera = &self.cameras[*index].projection;
            cubes[*index].add(camera, image, [&world_from_body, &world_from_submap], stamp.0);
        }
        let mut buffers = PointBuffers::default();
        let points = SubmapPoints::new(points, sweeps, begin, header.n_rings, &mut buffers);
        let column = SpectraColumn::new(&points, &self.bands, &cubes, LIMITS);
        let mut rows = vec![0; column.n_rows()];
        column.write_into(&mut rows);
        Ok(PointSpectra { header: Box::new(column.header()), rows, regions: column.regions() })
    }
}

impl CalibratedCamera {
    /// Header and rows of the cube of a raw frame.
    fn cube(&self, index: usize, raw: &[u16], median: bool) -> Result<(CubeHeader, Vec<u32>), SpectralError> {
        let mosaic = self.spectral.mosaic();
        let wavelengths_nm = self.spectral.wavelengths_nm();
        let [width, height] = mosaic.cells();
        let [x0, y0] = mosaic.origin();
        let mut header = CubeHeader {
            camera: index as u32,
            width,
            height,
            n_bands: wavelengths_nm.len() as u32,
            pattern: mosaic.pattern(),
            valid_bands: self.spectral.valid_bands(),
            x0,
            y0,
            exposure_nanos: EXPOSURE_NANOS,
            wavelengths_nm: [0.0; MAX_CUBE_BANDS],
        };
        header.wavelengths_nm[..wavelengths_nm.len()].copy_from_slice(wavelengths_nm);
        let n_values = mosaic.n_cells() * wavelengths_nm.len();
        let mut rows = vec![0; n_values + mosaic.n_cells()];
        let (values, masks) = rows.split_at_mut(n_values);
        self.spectral.cube_into(raw, EXPOSURE_NANOS, cast_slice_mut(values), masks)?;
        if median {
            median_3x3([width, height], cast_slice_mut(values), masks)?;
        }
        Ok((header, rows))
    }
}
