//! Pictures of point clouds, and the statistics that choose what they show.

mod bev_picture;
mod camera;
mod canvas;
mod cloud_facts;
mod cloud_summary;
mod loaded_cloud;
mod palette;
mod settings;

pub use bev_picture::{BevRequest, render_bev};
pub use camera::Camera;
pub use canvas::Canvas;
pub use cloud_facts::CloudFacts;
pub use cloud_summary::CloudSummary;
pub use loaded_cloud::LoadedCloud;
pub use palette::{Palette, ramp, share};
pub use settings::{Background, ColorBy, PictureSettings, PictureSize, Viewpoint};

use crate::cloud_files::cloud_files;
use anyhow::Context;
use std::path::{Path, PathBuf};

/// Statistics of all points of these files.
pub fn summarize(files: &[PathBuf]) -> anyhow::Result<CloudSummary> {
    let mut summary = CloudSummary::default();
    for file in files {
        summary.add(file, &LoadedCloud::load(file)?);
    }
    Ok(summary)
}

/// Renders the points of these files, which `summary` describes, into a PNG.
pub fn render(
    files: &[PathBuf],
    summary: &CloudSummary,
    settings: &PictureSettings,
    picture: &Path,
) -> anyhow::Result<()> {
    let bounds = summary.bounds().context("no points to render")?;
    let PictureSettings { size, at, .. } = *settings;
    let camera = match settings.viewpoint {
        Viewpoint::Top => Camera::top_view(bounds, summary.path(), size),
        Viewpoint::Street => Camera::street_view(bounds, summary.path(), at, size),
    };
    let palette = Palette::new(settings.color_by.unwrap_or_else(|| summary.default_coloring()), summary);
    let mut canvas = Canvas::new(size);
    for file in files {
        let cloud = LoadedCloud::load(file)?;
        for point_idx in 0..cloud.len() {
            canvas.splat(&camera, cloud.position(point_idx), [palette.color(&cloud, point_idx)]);
        }
    }
    let [pixels] = canvas.finish(settings.background);
    let (width, height) = (size.width as u32, size.height as u32);
    image::save_buffer_with_format(picture, &pixels, width, height, image::ColorType::Rgb8, image::ImageFormat::Png)
        .with_context(|| format!("{}: cannot write the picture", picture.display()))?;
    eprintln!("wrote {}", picture.display());
    Ok(())
}

/// Renders a cloud as `replica inspect CLOUD --picture PNG --view top` does.
pub fn render_top_view(path: &Path, picture: &Path) -> anyhow::Result<()> {
    let settings = PictureSettings {
        color_by: None,
        size: PictureSize { width: 1600, height: 900 },
        viewpoint: Viewpoint::Top,
        at: 0.0,
        background: Background::Dark,
    };
    let files = cloud_files(path)?;
    render(&files, &summarize(&files)?, &settings, picture).with_context(|| path.display().to_string())
}
