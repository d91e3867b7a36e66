//! `replica inspect`: what is in a cloud, as a table and as a picture; how far a run's points and images are apart.

mod camera;
mod canvas;
mod cloud;
mod offset;
mod palette;
mod recording;
mod survey;

use anyhow::{Context, ensure};
use camera::Camera;
use canvas::Canvas;
use clap::ValueEnum;
use cloud::Cloud;
pub use cloud::files as cloud_files;
use palette::Painter;
pub use palette::class_color;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;
use survey::Survey;

/// Exit code for a recording that does not have its run to the end.
const NOT_COMPLETE: u8 = 3;

/// Shows points, bounds, classes and instances of clouds, and renders a picture; or topics and times of a recording.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// A PLY file, the output folder of a run, or a recording (.mcap).
    path: PathBuf,
    /// Says how far points and images are apart, as the run in this output folder measured it, instead.
    #[arg(long, conflicts_with = "picture")]
    offset: bool,
    /// Renders a picture into this PNG.
    #[arg(long, value_name = "PNG")]
    picture: Option<PathBuf>,
    /// What the picture's colors say [default: color if there is any, else class, else height].
    #[arg(long)]
    by: Option<By>,
    /// Size of the picture, px.
    #[arg(long, default_value = "1600x900")]
    size: Size,
    /// From where the picture is taken.
    #[arg(long, default_value = "street")]
    view: View,
    /// Street view: where along the path the picture is taken, 0 to 1.
    #[arg(long, default_value_t = 0.35)]
    at: f64,
    /// What is behind the points.
    #[arg(long, default_value = "dark")]
    background: Background,
}

/// What a point's color stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum By {
    /// As the cameras saw it.
    Color,
    /// Its class, in CARLA's colors.
    Class,
    /// Strength of the return.
    Intensity,
    /// Height.
    Height,
    /// Its instance; the rest is gray.
    Instance,
}

/// Where the eye is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum View {
    /// From straight above, without perspective; north is up.
    Top,
    /// From behind and above the vehicle.
    Street,
}

/// What is behind the points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Background {
    /// Night blue.
    Dark,
    /// Paper.
    White,
}

/// Columns and rows, px.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Size {
    width: usize,
    height: usize,
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        // 8192 x 8192 takes 2 GB while it is rendered.
        let side = |text: &str| text.parse().ok().filter(|side| (16..=8192).contains(side));
        text.split_once('x')
            .and_then(|(width, height)| Some(Size { width: side(width)?, height: side(height)? }))
            .ok_or_else(|| "must be WIDTHxHEIGHT, each 16 to 8192".to_owned())
    }
}

/// Prints the table and renders the picture, if one is asked for.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    if args.offset {
        let _ = std::io::stdout().write_all(offset::report(&args.path)?.as_bytes());
        return Ok(ExitCode::SUCCESS);
    }
    if args.path.extension().is_some_and(|extension| extension == "mcap") {
        let (table, complete) = recording::table(&args.path)?;
        let _ = std::io::stdout().write_all(table.as_bytes());
        return Ok(if complete { ExitCode::SUCCESS } else { ExitCode::from(NOT_COMPLETE) });
    }
    ensure!((0.0..=1.0).contains(&args.at), "--at is {}, must be between 0 and 1", args.at);
    let files = cloud::files(&args.path)?;
    let survey = surveyed(&files)?;
    // A reader that closes the pipe early has seen what it wanted.
    let _ = std::io::stdout().write_all(survey.table(&args.path).as_bytes());
    let Some(picture) = &args.picture else { return Ok(ExitCode::SUCCESS) };
    render(&files, &survey, args, picture)?;
    Ok(ExitCode::SUCCESS)
}

/// A picture from straight above, as `replica inspect CLOUD --picture PNG --view top` makes it.
pub fn top_view(path: &Path, picture: &Path) -> anyhow::Result<()> {
    let args = Args {
        path: path.to_owned(),
        offset: false,
        picture: Some(picture.to_owned()),
        by: None,
        size: Size { width: 1600, height: 900 },
        view: View::Top,
        at: 0.0,
        background: Background::Dark,
    };
    let files = cloud::files(path)?;
    render(&files, &surveyed(&files)?, &args, picture)
}

fn surveyed(files: &[PathBuf]) -> anyhow::Result<Survey> {
    let mut survey = Survey::default();
    for file in files {
        survey.add(file, &Cloud::load(file)?);
    }
    Ok(survey)
}

fn render(files: &[PathBuf], survey: &Survey, args: &Args, picture: &Path) -> anyhow::Result<()> {
    let bounds = survey.bounds().with_context(|| format!("{}: no points to render", args.path.display()))?;
    let camera = match args.view {
        View::Top => Camera::above(bounds, survey.path(), args.size),
        View::Street => Camera::behind(bounds, survey.path(), args.at, args.size),
    };
    let painter = Painter::new(args.by.unwrap_or_else(|| survey.best_color()), survey);
    let mut canvas = Canvas::new(args.size);
    for file in files {
        let cloud = Cloud::load(file)?;
        for point_idx in 0..cloud.len() {
            canvas.splat(&camera, cloud.position(point_idx), painter.color(&cloud, point_idx));
        }
    }
    let pixels = canvas.develop(args.background);
    let (width, height) = (args.size.width as u32, args.size.height as u32);
    image::save_buffer_with_format(picture, &pixels, width, height, image::ColorType::Rgb8, image::ImageFormat::Png)
        .with_context(|| format!("{}: cannot write the picture", picture.display()))?;
    eprintln!("wrote {}", picture.display());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use formats::ply::{Header, Kind, PlyWriter};

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        args: Args,
    }

    /// A road 40 m long with a car on it, driven along x.
    fn write_street(path: &Path) {
        let names = ["x", "y", "z", "x_lidar_position", "y_lidar_position", "z_lidar_position"];
        let fields = names.map(|name| (name, Kind::Float)).into_iter();
        let header = Header::new(fields.chain([("semantic", Kind::UChar), ("instance", Kind::Int)]));
        let mut writer = PlyWriter::create(path, &header, 400 * 100).expect("creates");
        let encode = |i: usize, row: &mut formats::ply::Row<'_>| {
            let (x, y) = ((i / 100) as f32 * 0.1, (i % 100) as f32 * 0.1 - 5.0);
            let is_car = (20.0..24.0).contains(&x) && (1.0..3.0).contains(&y);
            row.f32(x).f32(y).f32(if is_car { 1.5 } else { 0.0 }).f32(x).f32(0.0).f32(2.0);
            row.u8(if is_car { 10 } else { 7 }).i32(if is_car { 4 } else { 0 });
        };
        writer.write_each(400 * 100, encode).expect("writes");
        writer.finish().expect("finishes");
    }

    #[test]
    fn a_run_s_folder_becomes_a_table_and_a_picture() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::create_dir(folder.path().join("clouds")).expect("creates");
        write_street(&folder.path().join("clouds/submap_0000.ply"));
        write_street(&folder.path().join("clouds/submap_0000_spectra.ply"));
        let files = cloud::files(folder.path()).expect("has clouds");
        assert_eq!(files.len(), 1, "spectra are not points of their own");
        let mut survey = Survey::default();
        survey.add(&files[0], &Cloud::load(&files[0]).expect("loads"));
        let table = survey.table(folder.path());
        for line in ["1 clouds, 40 000 points", "path 39.", "instances 1", "road", "98.0 %", "vehicles", "2.0 %"] {
            assert!(table.contains(line), "{line:?} is not in\n{table}");
        }
        for (view, by) in [("street", "class"), ("top", "instance"), ("top", "height")] {
            let picture = folder.path().join(format!("{view}_{by}.png"));
            let (input, output) = (folder.path().to_string_lossy(), picture.to_string_lossy());
            let words = ["", &input, "--picture", &output, "--view", view, "--by", by, "--size", "320x180"];
            run(&Cli::parse_from(words).args).expect("renders");
            let image = image::open(&picture).expect("is a picture").to_rgb8();
            assert_eq!(image.dimensions(), (320, 180));
            let of_car = |p: &image::Rgb<u8>| if by == "class" { p.0[2] > 180 && p.0[0] < 60 } else { p.0[1] > 140 };
            let n_car = image.pixels().filter(|pixel| of_car(pixel)).count();
            assert!((20..8000).contains(&n_car), "{view} {by}: {n_car} pixels of the car");
        }
    }

    #[test]
    fn what_cannot_be_shown_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().to_string_lossy();
        let error = run(&Cli::parse_from(["", &path]).args).expect_err("is empty").to_string();
        assert!(error.contains("there are no clouds"), "{error}");
        for words in [["", &path, "--size", "16x9"], ["", &path, "--size", "1600"], ["", &path, "--by", "taste"]] {
            assert!(Cli::try_parse_from(words).is_err());
        }
        let outside = Cli::parse_from(["", &path, "--at", "1.5"]);
        assert!(run(&outside.args).expect_err("is outside").to_string().contains("between 0 and 1"));
    }
}
