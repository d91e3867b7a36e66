//! Pictures of point clouds, and the statistics that select their content.

mod bev_picture;
mod camera;
mod canvas;
mod cloud_facts;
mod cloud_summary;
mod color_by;
mod loaded_cloud;
mod overlay;
mod palette;
mod settings;
mod spectra;
mod text;

pub use bev_picture::{BevRequest, render_bev};
pub use camera::Camera;
pub use canvas::Canvas;
pub use cloud_facts::CloudFacts;
pub use cloud_summary::CloudSummary;
pub use color_by::{ColorBy, ColorByParser};
pub use loaded_cloud::LoadedCloud;
pub use overlay::round_length;
pub use palette::{Palette, ramp, share};
pub use settings::{At, Background, PictureSettings, PictureSize, Viewpoint};

use crate::cloud_files::cloud_files;
use anyhow::{Context, bail, ensure};
use image::{ImageFormat, RgbImage};
use std::path::{Path, PathBuf};

/// Default radius of a view of a place, m: a house and the street in front of it.
pub const DEFAULT_RADIUS_M: f64 = 15.0;
/// Default wavelength of the band, nm: red, which most mosaic cameras have.
pub const DEFAULT_BAND_NM: f64 = 650.0;

/// Statistics of all points of these files, with the values that a coloring needs.
pub fn summarize(files: &[PathBuf], by: Option<&ColorBy>, band_nm: f64) -> anyhow::Result<CloudSummary> {
    let mut summary = CloudSummary::default();
    for file in files {
        summary.add(file, &load(file, by, band_nm)?);
    }
    Ok(summary)
}

fn load(file: &Path, by: Option<&ColorBy>, band_nm: f64) -> anyhow::Result<LoadedCloud> {
    match by {
        Some(ColorBy::Band) => LoadedCloud::load_with_band(file, band_nm),
        Some(ColorBy::Field(field)) => LoadedCloud::load_with_field(file, field),
        _ => LoadedCloud::load(file),
    }
}

/// Renders the points of these files, which `summary` describes, into a PNG.
pub fn render(
    files: &[PathBuf],
    summary: &CloudSummary,
    settings: &PictureSettings,
    picture: &Path,
) -> anyhow::Result<()> {
    let color_by = settings.color_by.clone().unwrap_or_else(|| summary.default_coloring());
    if let Some(what) = summary.lacks(&color_by) {
        bail!("the clouds have no {what}");
    }
    let size = settings.size;
    let camera = camera(summary, settings)?;
    let palette = Palette::new(color_by.clone(), summary);
    let mut canvas = Canvas::new(size);
    for (number, file) in files.iter().enumerate() {
        let cloud = load(file, Some(&color_by), settings.band_nm)?;
        for point_idx in 0..cloud.len() {
            canvas.splat(&camera, cloud.position(point_idx), [palette.color(&cloud, number, point_idx)]);
        }
    }
    let [pixels] = canvas.finish(settings.background);
    let mut image = RgbImage::from_raw(size.width as u32, size.height as u32, pixels).context("a pixel has 3 bytes")?;
    if !settings.is_plain {
        overlay::draw_over(&mut image, &camera, &palette.legend(summary, settings.band_nm), summary.path());
    }
    image
        .save_with_format(picture, ImageFormat::Png)
        .with_context(|| format!("{}: cannot write the picture", picture.display()))?;
    eprintln!("wrote {}", picture.display());
    Ok(())
}

fn camera(summary: &CloudSummary, settings: &PictureSettings) -> anyhow::Result<Camera> {
    let bounds = summary.bounds().context("no points to render")?;
    let PictureSettings { size, radius_m, at, viewpoint, .. } = *settings;
    if let At::Place([x, y]) = at {
        let [min, max] = bounds;
        let is_inside = (min[0]..=max[0]).contains(&x) && (min[1]..=max[1]).contains(&y);
        ensure!(
            is_inside,
            "--at {x},{y}: the clouds reach from {:.1},{:.1} to {:.1},{:.1}",
            min[0],
            min[1],
            max[0],
            max[1]
        );
    }
    Ok(match (viewpoint, at) {
        (Viewpoint::Top, At::Share(_)) => Camera::top_view(bounds, summary.path(), size),
        (Viewpoint::Top, At::Place(place)) => Camera::top_view_of(place, radius_m, bounds, size),
        (Viewpoint::Street, At::Share(share)) => Camera::street_view(bounds, summary.path(), share, size),
        (Viewpoint::Street, At::Place(place)) => {
            // Most points are on the ground, and the lowest points are errors.
            let [ground_m, _] = summary.height_range();
            Camera::street_view_of(place, radius_m, ground_m, summary.path(), size)
        }
    })
}

/// Renders a cloud as `replica inspect CLOUD --picture PNG --view top` does.
pub fn render_top_view(path: &Path, picture: &Path) -> anyhow::Result<()> {
    let settings = PictureSettings {
        color_by: None,
        size: PictureSize { width: 1600, height: 900 },
        viewpoint: Viewpoint::Top,
        at: At::Share(0.0),
        radius_m: DEFAULT_RADIUS_M,
        band_nm: DEFAULT_BAND_NM,
        background: Background::Dark,
        is_plain: false,
    };
    let files = cloud_files(path)?;
    render(&files, &summarize(&files, None, DEFAULT_BAND_NM)?, &settings, picture)
        .with_context(|| path.display().to_string())
}
