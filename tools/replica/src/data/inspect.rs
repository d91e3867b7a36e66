//! `replica inspect`: what a drive, a cloud or a recording contains; the measured offset between points and images of a run.

pub mod drive;
pub mod georeference;
mod imported;
mod offset;
mod recording;

use super::report::StageDoubt;
use anyhow::Context;
use command_line::answer::Answer;
use command_line::argument::positive;
use command_line::exit_code;
use command_line::usage_error::UsageError;
use delivery::GeoreferenceFile;
use drive::Reading;
use pictures::cloud_files::cloud_files;
use pictures::cloud_picture::{
    At, Background, BevRequest, CloudFacts, ColorBy, ColorByParser, DEFAULT_BAND_NM, DEFAULT_RADIUS_M, PictureSettings,
    PictureSize, Viewpoint, render, render_bev, summarize,
};
use recording::RecordingFacts;
use run::summary::Summary;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Show what a drive, a cloud, a run or a recording contains.
///
/// For drives and captures: sensors, rates, gaps, clocks, coverage, doubts, and optionally a page with pictures. For clouds: points, bounds, classes and instances, and optionally a picture; for a run also the world frame with its standard
/// deviations, and its doubts. For a recording: topics, counts and times.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "Exit codes: 0 done, also if a run has doubts, which are printed; 1 failed, 2 wrong usage, 3 the recording is \
                  not complete, or a drive has doubts\n\n\
                  Example: replica inspect drives/sample --page drive.html"
)]
pub struct Args {
    /// Drive folder, folder of sweeps, capture, PLY file, output folder of a run, or recording (.mcap)
    path: PathBuf,
    /// Drive: read all sweeps and images instead of a few
    #[arg(long, conflicts_with_all = ["offset", "picture"])]
    full: bool,
    /// Drive: also write one HTML page with pictures and charts
    #[arg(long, value_name = "HTML", conflicts_with_all = ["offset", "picture"])]
    page: Option<PathBuf>,
    /// Show the offset between points and images instead, as the run in this output folder measured it
    #[arg(long, conflicts_with = "picture")]
    offset: bool,
    /// Render a picture into this PNG
    #[arg(long, value_name = "PNG")]
    picture: Option<PathBuf>,
    /// What the colors of the picture show: one of these words, or the name of any other column of the clouds [default: color if the cloud
    /// has it, else class, else height]
    #[arg(long, value_name = "WORD", value_parser = ColorByParser)]
    by: Option<ColorBy>,
    /// Top-down image of a column: z:max, or intensity:mean:0.2 (m)
    #[arg(
        long,
        value_name = "FEATURE:STATISTIC[:CELL_M]",
        requires = "picture",
        conflicts_with_all = ["by", "size", "view", "at"],
        long_help = "Top-down image (bird's-eye view) of a column instead of a picture of points: one pixel for each cell, north up; \
                     cells without points have the color of the background. STATISTIC is max, min, difference (max - min), \
                     accumulation (number of points) or mean. Cells have 0.1 m by default"
    )]
    bev: Option<BevRequest>,
    /// Width and height of the picture, px (16 to 8192 each)
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "1600x900")]
    size: PictureSize,
    /// Viewpoint of the picture
    #[arg(long, default_value = "street")]
    view: Viewpoint,
    /// Street view: position along the path, 0 to 1. Both views: X,Y shows this place, m in the frame of the clouds
    #[arg(long, value_name = "SHARE|X,Y", default_value = "0.35", allow_hyphen_values = true)]
    at: At,
    /// With --at X,Y: how far around the place the picture reaches, m
    #[arg(long, value_name = "M", default_value_t = DEFAULT_RADIUS_M, value_parser = positive)]
    radius: f64,
    /// With --by band: the band nearest to this wavelength, nm
    #[arg(long, value_name = "NM", default_value_t = DEFAULT_BAND_NM, value_parser = positive)]
    band_nm: f64,
    /// Only points: no legend, scale bar, north arrow or path
    #[arg(long)]
    plain: bool,
    /// Background of the picture
    #[arg(long, default_value = "dark")]
    background: Background,
    #[command(flatten)]
    answer: Answer,
}

/// Prints the table and renders the picture, if one is requested.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    if args.offset {
        let offset = offset::read(&args.path)?;
        args.answer.print(&offset, || offset.text())?;
        return Ok(ExitCode::SUCCESS);
    }
    if args.path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("mcap")) {
        let recording = RecordingFacts::read(&args.path)?;
        args.answer.print(&recording, || recording.table())?;
        return Ok(if recording.complete { ExitCode::SUCCESS } else { ExitCode::from(exit_code::INCOMPLETE) });
    }
    if drive::is_drive(&args.path) {
        let reading = if args.full { Reading::All } else { Reading::Samples };
        return drive::run(&args.path, reading, args.page.as_deref(), args.answer);
    }
    if args.full || args.page.is_some() {
        let path = args.path.display();
        let rule = "--full and --page need a drive folder, a folder of sweeps or a capture";
        return Err(UsageError(format!("{path}: {rule}")).into());
    }
    if let Some(rule) = imported::rule(&args.path) {
        return Err(UsageError(rule).into());
    }
    let files = cloud_files(&args.path)?;
    let summary = summarize(&files, args.by.as_ref(), args.band_nm)?;
    let result = ResultFacts::new(&args.path, summary.facts());
    args.answer.print(&result, || result.text())?;
    if let (Some(request), Some(picture)) = (&args.bev, &args.picture) {
        let line = render_bev(&files, &summary, request, args.background, picture)
            .with_context(|| args.path.display().to_string())?;
        eprint!("{line}");
    } else if let Some(picture) = &args.picture {
        let settings = PictureSettings {
            color_by: args.by.clone(),
            size: args.size,
            viewpoint: args.view,
            at: args.at,
            radius_m: args.radius,
            band_nm: args.band_nm,
            background: args.background,
            is_plain: args.plain,
        };
        render(&files, &summary, &settings, picture).with_context(|| args.path.display().to_string())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Clouds, and the georeference and doubts of the run that made them.
#[derive(Serialize)]
struct ResultFacts {
    path: String,
    #[serde(flatten)]
    clouds: CloudFacts,
    georeference: Option<GeoreferenceFile>,
    /// Doubts of stages. Empty for a folder without a summary: clouds may be in any folder.
    doubts: Vec<StageDoubt>,
}

impl ResultFacts {
    fn new(path: &Path, clouds: CloudFacts) -> Self {
        Self {
            path: path.display().to_string(),
            clouds,
            georeference: georeference::load(path),
            doubts: StageDoubt::from_summary(&Summary::load(path).unwrap_or_default()),
        }
    }

    fn text(&self) -> String {
        let doubts = self.doubts.iter().map(|doubt| format!("doubt ({}): {}\n", doubt.stage, doubt.doubt.text));
        let georeference = self.georeference.as_ref().map(georeference::lines).unwrap_or_default();
        self.clouds.table(&self.path) + &georeference + &doubts.collect::<String>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use command_line::argument::Cli;
    use formats::ply::{Header, Kind, PlyWriter};

    /// A road of 40 m along x with a car on it.
    fn write_street(path: &Path) {
        let names = ["x", "y", "z", "x_lidar_position", "y_lidar_position", "z_lidar_position"];
        let fields = names.map(|name| (name, Kind::Float)).into_iter();
        let header = Header::new(fields.chain([("semantic", Kind::UChar), ("instance", Kind::Int)]));
        let mut writer = PlyWriter::create(path, &header, 400 * 100).expect("creates");
        let encode = |i: usize, row: &mut formats::ply::Row<'_>| {
            let x = (i / 100) as f32 * 0.1;
            let y = (i % 100) as f32 * 0.1 - 5.0;
            let is_car = (20.0..24.0).contains(&x) && (1.0..3.0).contains(&y);
            row.f32(x).f32(y).f32(if is_car { 1.5 } else { 0.0 }).f32(x).f32(0.0).f32(2.0);
            row.u8(if is_car { 10 } else { 7 }).i32(if is_car { 4 } else { 0 });
        };
        writer.write_each(400 * 100, encode).expect("writes");
        writer.finish().expect("finishes");
    }

    #[test]
    fn run_folder_is_summarized_and_rendered() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::create_dir(folder.path().join("clouds")).expect("creates");
        write_street(&folder.path().join("clouds/submap_0000.ply"));
        write_street(&folder.path().join("clouds/submap_0000_spectra.ply"));
        let files = cloud_files(folder.path()).expect("has clouds");
        assert_eq!(files.len(), 1, "files of spectra are not clouds");
        let table = summarize(&files, None, DEFAULT_BAND_NM).expect("loads").facts().table("street");
        for line in ["1 clouds, 40 000 points", "path 39.", "instances 1", "road", "98.0 %", "vehicles", "2.0 %"] {
            assert!(table.contains(line), "{line:?} is not in\n{table}");
        }
        for (view, by) in [("street", "class"), ("top", "instance"), ("top", "height")] {
            let picture = folder.path().join(format!("{view}_{by}.png"));
            let input = folder.path().to_string_lossy();
            let output = picture.to_string_lossy();
            let words = ["", &input, "--picture", &output, "--view", view, "--by", by, "--size", "320x180", "--plain"];
            run(&Cli::parse_from(words).args).expect("renders");
            let image = image::open(&picture).expect("is a picture").to_rgb8();
            assert_eq!(image.dimensions(), (320, 180));
            let of_car = |p: &image::Rgb<u8>| if by == "class" { p.0[2] > 180 && p.0[0] < 60 } else { p.0[1] > 140 };
            let n_car = image.pixels().filter(|pixel| of_car(pixel)).count();
            assert!((20..8000).contains(&n_car), "{view} {by}: {n_car} pixels of the car");
        }
    }

    #[test]
    fn close_up_of_a_place_shows_it_and_columns_must_be_there() {
        let folder = tempfile::tempdir().expect("a folder");
        let cloud = folder.path().join("street.ply");
        write_street(&cloud);
        let picture = folder.path().join("car.png");
        let input = cloud.to_string_lossy();
        let output = picture.to_string_lossy();
        let words = ["", &input, "--picture", &output, "--by", "class", "--size", "320x180", "--plain"];
        let n_car = |more: &[&str]| {
            run(&Cli::parse_from([&words[..], more].concat()).args).expect("renders");
            let image = image::open(&picture).expect("is a picture").to_rgb8();
            image.pixels().filter(|pixel| pixel.0[2] > 180 && pixel.0[0] < 60).count()
        };
        for view in ["top", "street"] {
            let [near, far] = ["22,2", "5,-3"].map(|at| n_car(&["--view", view, "--at", at, "--radius", "4"]));
            assert!(near > 300 && far == 0, "{view}: {near} and {far} pixels of the car");
        }
        let error = |more: &[&str]| {
            format!("{:#}", run(&Cli::parse_from([&words[..4], more].concat()).args).expect_err("is refused"))
        };
        assert!(error(&["--by", "score"]).contains("the clouds have no column `score`"));
        assert!(error(&["--by", "taste"]).contains("the clouds have no column `taste`; --by also takes"));
        assert!(error(&["--by", "band"]).contains("the clouds have no spectra"));
        assert!(error(&["--at", "-90,2"]).contains("--at -90,2: the clouds reach from 0.0,-5.0 to 39.9,4.9"));
    }

    #[test]
    fn bev_image_has_a_pixel_for_each_cell_with_north_up() {
        let folder = tempfile::tempdir().expect("a folder");
        let cloud = folder.path().join("street.ply");
        write_street(&cloud);
        let picture = folder.path().join("bev.png");
        let input = cloud.to_string_lossy();
        let output = picture.to_string_lossy();
        run(&Cli::parse_from(["", &input, "--picture", &output, "--bev", "z:max:1", "--background", "white"]).args)
            .expect("renders");
        let image = image::open(&picture).expect("is a picture").to_rgb8();
        assert_eq!(image.dimensions(), (40, 10), "40 m east, 10 m north");
        // The car lies at 20 to 24 m east, 1 to 3 m north: the picture's rows 2 and 3 of 10 from the top.
        let yellow: Vec<(u32, u32)> =
            image.enumerate_pixels().filter(|(_, _, pixel)| pixel.0[0] > 200).map(|(x, y, _)| (x, y)).collect();
        for place in [(20, 2), (23, 3), (21, 2)] {
            assert!(yellow.contains(&place), "{place:?} in {yellow:?}");
        }
        assert!(yellow.iter().all(|(x, y)| (20..=24).contains(x) && (1..=4).contains(y)), "{yellow:?}");
        let taste = Cli::parse_from(["", &input, "--picture", &output, "--bev", "taste:max"]);
        let error = format!("{:#}", run(&taste.args).expect_err("has no such column"));
        assert!(error.contains("taste"), "{error}");
        assert!(Cli::<Args>::try_parse_from(["", &input, "--bev", "z:max"]).is_err(), "needs a picture");
    }

    #[test]
    fn invalid_arguments_are_reported() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().to_string_lossy();
        let error = run(&Cli::parse_from(["", &path]).args).expect_err("is empty").to_string();
        assert!(error.contains("no clouds (*.ply)"), "{error}");
        for words in [["", &path, "--size", "16x9"], ["", &path, "--size", "1600"], ["", &path, "--by", "a taste"]] {
            assert!(Cli::<Args>::try_parse_from(words).is_err());
        }
        assert!(Cli::<Args>::try_parse_from(["", &path, "--at", "1.5"]).is_err(), "is outside of the path");
    }
}
