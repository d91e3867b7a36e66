//! What a stage alone is told: on its command line, by a launch file, and by the recording that it reads.

use crate::command::own_table;
use crate::launch_file::LaunchFile;
use crate::{Context, Mode, Port, Stage, parse_table};
use formats::recording::RecordingReader;
use std::path::{Path, PathBuf};
use toml::de::DeValue;

/// How it is called, for the help.
pub(crate) const USAGE: &str = "\
run --recording IN.mcap [--record OUT.mcap] [--launch launch.toml] [--set TABLE.KEY=VALUE]... [--drive FOLDER]
      [--output FOLDER] [--json]
                     run alone on a recording of its inputs (a source: on --drive), outputs into a recording;
                     then say what the steps cost";

/// Drive time between barriers if no launch file says otherwise, s: as `[run]` has it.
const BARRIER_S: f64 = 5.0;

/// The command line.
#[derive(Default)]
pub(super) struct Arguments {
    pub(super) recording: Option<PathBuf>,
    pub(super) record: Option<PathBuf>,
    pub(super) launch: Option<PathBuf>,
    pub(super) drive: Option<PathBuf>,
    pub(super) output: Option<PathBuf>,
    pub(super) overrides: Vec<String>,
    pub(super) json: bool,
}

impl Arguments {
    pub(super) fn parse(arguments: &[&str]) -> Result<Self, String> {
        let mut parsed = Self::default();
        let mut rest = arguments.iter();
        while let Some(argument) = rest.next() {
            if *argument == "--json" {
                parsed.json = true;
                continue;
            }
            let slot = match *argument {
                "--recording" => &mut parsed.recording,
                "--record" => &mut parsed.record,
                "--launch" => &mut parsed.launch,
                "--drive" => &mut parsed.drive,
                "--output" => &mut parsed.output,
                "--set" => {
                    let text = rest.next().ok_or("--set: TABLE.KEY=VALUE must follow")?;
                    parsed.overrides.push((*text).to_owned());
                    continue;
                }
                other => return Err(format!("unknown argument of run: {other}")),
            };
            let value = rest.next().ok_or_else(|| format!("{argument}: a path must follow"))?;
            *slot = Some(PathBuf::from(value));
        }
        Ok(parsed)
    }
}

/// Settings of the stage, where it runs, drive time between barriers; or everything that is wrong.
pub(super) fn configure<S: Stage>(arguments: &Arguments) -> Result<(S::Settings, Context, f64), Vec<String>> {
    let absolute =
        |path: &Path| std::path::absolute(path).map_err(|error| vec![format!("{}: {error}", path.display())]);
    let launch = arguments.launch.as_deref().map(absolute).transpose()?;
    let file = match &launch {
        Some(path) => LaunchFile::load(path, &arguments.overrides),
        None => LaunchFile::parse(Path::new("command line"), String::new(), &arguments.overrides),
    };
    let file = file.map_err(|problems| problems.iter().map(|p| format!("{} {}", p.key, p.text)).collect::<Vec<_>>())?;
    let rendered = |problem| vec![file.render(&problem)];
    let (settings, problems) = parse_table::<S::Settings>(&own_table(&file, S::NAME).map_err(rendered)?);
    let mut faults: Vec<String> = problems.into_iter().map(|p| file.render(&file.located(S::NAME, p))).collect();

    let folder =
        launch.as_deref().and_then(Path::parent).map_or_else(|| absolute(Path::new(".")), |f| Ok(f.to_owned()))?;
    let run = file.table("run").map_err(rendered)?;
    let of_run = |key: &str| run.iter().find(|(name, _)| name.get_ref() == key).map(|(_, value)| value.get_ref());
    let place = |given: &Option<PathBuf>, key: &str| match (given, of_run(key).and_then(DeValue::as_str)) {
        (Some(path), _) => absolute(path).map(Some),
        (None, Some(text)) => Ok(Some(folder.join(text))),
        (None, None) => Ok(None),
    };
    let (drive, output) = (place(&arguments.drive, "drive")?, place(&arguments.output, "output")?);
    if drive.is_none() && S::inputs().is_empty() {
        faults.push("run: a source needs --drive, or a launch file with run.drive".to_owned());
    }
    if output.is_none() && S::outputs().is_empty() {
        faults.push("run: a stage that writes files needs --output, or a launch file with run.output".to_owned());
    }
    let barrier_s = match of_run("barrier_s") {
        Some(DeValue::Float(number)) => number.as_str().parse().ok(),
        Some(DeValue::Integer(number)) => number.as_str().parse().ok(),
        _ => None,
    };
    let recorded = match &arguments.recording {
        Some(path) => recorded_topics::<S>(path).unwrap_or_else(|error| {
            faults.push(error);
            Vec::new()
        }),
        None => Vec::new(),
    };
    let own = S::outputs().iter().map(|port| port.topic().to_owned()).collect::<Vec<_>>();
    let context = Context {
        drive: drive.unwrap_or_default(),
        output: output.unwrap_or_else(|| folder.clone()),
        launch_folder: folder,
        mode: Mode::Offline,
        connected: recorded.into_iter().chain(own).collect(),
    };
    // A setting that is wrong by itself would only give rise to further errors.
    if faults.is_empty() {
        faults.extend(S::check(&settings, &context).into_iter().map(|p| file.render(&file.located(S::NAME, p))));
    }
    if faults.is_empty() { Ok((settings, context, barrier_s.unwrap_or(BARRIER_S))) } else { Err(faults) }
}

/// Topics of the recording; an error if it lacks one that the stage needs or has one of another layout.
fn recorded_topics<S: Stage>(path: &Path) -> Result<Vec<String>, String> {
    let reader = RecordingReader::open(path).map_err(|error| error.to_string())?;
    for port in S::inputs().iter().map(Port::describe) {
        let Some(topic) = reader.topics().iter().find(|topic| topic.name == port.topic) else {
            if port.optional {
                tracing::info!("optional topic {} is not in {}: it stays silent", port.topic, path.display());
                continue;
            }
            return Err(format!("{}: has no topic {}, which {} needs", path.display(), port.topic, S::NAME));
        };
        let (theirs, ours) = ((topic.table.version, topic.table.layout), (port.version, port.layout));
        if theirs != ours {
            let file = path.display();
            return Err(format!(
                "{file}: topic {} has version {} and layout {:016x}, {} reads version {} and layout {:016x}",
                port.topic,
                theirs.0,
                theirs.1,
                S::NAME,
                ours.0,
                ours.1
            ));
        }
    }
    Ok(reader.topics().iter().filter_map(|topic| topic.ticks_of()).map(str::to_owned).collect())
}
