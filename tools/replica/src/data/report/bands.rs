//! Reflectances of the points by band, and their diagnosis.

use super::finished_run::FinishedRun;
use drive::Drive;
use formats::ply::PlyRows;
use pictures::bands::channel::Channel;
use pictures::bands::charts::{distribution, histogram};
use pictures::bands::diagnosis::diagnose;
use pictures::bands::source::{RawCounts, Source};
use serde::Serialize;
use spectral::FrameCounts;

/// Spectra that are read.
const MAX_SPECTRA: u64 = 50_000;

/// All bands of the run.
pub struct Bands {
    sources: Vec<Source>,
    pub diagnosis: Vec<Diagnosis>,
    pub bands: Vec<Band>,
}

/// Findings about one camera.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    pub camera: String,
    pub findings: Vec<String>,
}

/// One band.
#[derive(Clone, Debug, Serialize)]
pub struct Band {
    pub camera: String,
    pub wavelength_nm: f32,
    /// Mean of the reflectances, 1 = white. `None` without a value.
    pub mean: Option<f64>,
    pub deviation: Option<f64>,
}

impl Bands {
    /// `None` without spectra.
    pub fn from_run(run: &FinishedRun, drive: Option<&Drive>) -> anyhow::Result<Option<Self>> {
        let clouds = run.index.iter().flat_map(|index| &index.clouds);
        let spectra: Vec<_> = clouds.filter_map(|cloud| cloud.spectra.as_ref()).filter(|s| s.n_spectra > 0).collect();
        let n_spectra: u64 = spectra.iter().map(|spectra| spectra.n_spectra).sum();
        let step = n_spectra.div_ceil(MAX_SPECTRA).max(1) as usize;
        let mut sources: Vec<Source> = Vec::new();
        for cloud in spectra {
            let rows = PlyRows::open(&run.folder.join(&cloud.file))?;
            let infos = &rows.header().infos;
            let columns: Vec<String> = rows.header().properties.iter().map(|p| p.name.clone()).collect();
            let columns: Vec<&String> = columns.iter().filter(|name| name.starts_with("band_")).collect();
            let values = rows.thinned(step)?;
            for (band, (column, nm)) in columns.iter().zip(&cloud.wavelengths_nm).enumerate() {
                let camera = camera_of(infos, band);
                let name = name_of(drive, camera);
                let channel = channel_of(&mut sources, name, *nm);
                for value in values.f32s(column)? {
                    if value.is_finite() {
                        channel.add(value);
                    }
                }
            }
        }
        if sources.is_empty() {
            return Ok(None);
        }
        let sources: Vec<Source> = sources.into_iter().map(Source::sorted).collect();
        let mut diagnosis: Vec<Diagnosis> = sources
            .iter()
            .map(|source| Diagnosis { camera: source.name.clone(), findings: diagnose(source) })
            .collect();
        diagnosis.extend(raw_sample_diagnosis(run));
        let bands = sources.iter().flat_map(|source| {
            source.channels.iter().map(|channel| Band {
                camera: source.name.clone(),
                wavelength_nm: channel.wavelength_nm,
                mean: channel.mean(),
                deviation: channel.deviation(),
            })
        });
        Ok(Some(Self { bands: bands.collect(), diagnosis, sources }))
    }

    /// Histograms, and mean and deviation over the wavelength.
    pub fn charts(&self) -> [String; 2] {
        let channels: Vec<Vec<Channel>> = self.sources.iter().map(|source| source.channels.clone()).collect();
        [histogram, distribution].map(|chart| chart(&self.sources, &channels, "reflectance").svg())
    }
}

/// Diagnosis of the raw samples of all cameras, from the counts of `calibrate`.
fn raw_sample_diagnosis(run: &FinishedRun) -> Option<Diagnosis> {
    let counter = |name: &str| run.counter("calibrate", name);
    let counts = FrameCounts {
        dead: counter("dead_samples"),
        saturated: counter("saturated_samples"),
        clipped: counter("clipped_samples"),
    };
    let raw = RawCounts { n_frames: 0, n_samples: counter("samples"), counts };
    let source = Source { name: String::new(), channels: Vec::new(), raw: Some(raw), region: None };
    (raw.n_samples > 0).then(|| Diagnosis { camera: "raw samples".to_owned(), findings: diagnose(&source) })
}

/// The mosaic camera of a band, from the line `band N camera K center W nm`.
fn camera_of(infos: &[String], band: usize) -> Option<usize> {
    let line = infos.iter().find_map(|info| info.strip_prefix(&format!("band {band} camera ")))?;
    line.split_whitespace().next()?.parse().ok()
}

fn name_of(drive: Option<&Drive>, camera: Option<usize>) -> String {
    let entry = drive.zip(camera).and_then(|(drive, camera)| drive.manifest().mosaics.get(camera));
    let number = || camera.map_or("mosaic camera".to_owned(), |camera| format!("mosaic camera {camera}"));
    entry.map_or_else(number, |entry| entry.name.clone())
}

fn channel_of(sources: &mut Vec<Source>, name: String, nm: f32) -> &mut Channel {
    let at = sources.iter().position(|source| source.name == name).unwrap_or_else(|| {
        sources.push(Source::new(name, &[]));
        sources.len() - 1
    });
    let channels = &mut sources[at].channels;
    let index = channels.iter().position(|channel| channel.wavelength_nm == nm).unwrap_or_else(|| {
        channels.push(Channel::new(nm));
        channels.len() - 1
    });
    &mut channels[index]
}
