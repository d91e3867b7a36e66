//! The configuration of a stage alone: command line, launch file, and the recording that it reads.

use crate::command_line::AloneArguments;
use crate::own_table::own_table;
use crate::program::{ConfiguredStage, Program};
use crate::{Context, Mode, Port, Problem};
use recording::{RecordingError, RecordingReader};
use run::launch_file::LaunchFile;
use std::path::{Path, PathBuf};
use toml::de::DeValue;

/// Drive time between barriers if no launch file sets it, s: the default of `[run]`.
const BARRIER_S: f64 = 20.0;

/// Why a stage cannot run alone.
#[derive(Debug, thiserror::Error)]
pub(super) enum ConfigurationError {
    #[error("{}: {cause}", path.display())]
    Path {
        path: PathBuf,
        #[source]
        cause: std::io::Error,
    },
    /// Problems of the launch file, rendered by [`LaunchFile::render`].
    #[error("{0}")]
    Launch(String),
    #[error("run: a source needs --drive, or a launch file with run.drive")]
    NoDrive,
    #[error("run: a stage that writes files needs --output, or a launch file with run.output")]
    NoOutput,
    #[error(transparent)]
    Recording(#[from] RecordingError),
    #[error("{}: has no topic {topic}, which {stage} needs", path.display())]
    NoTopic { path: PathBuf, topic: String, stage: &'static str },
    /// Every input is optional and none is recorded.
    #[error(
        "{}: has no input of {stage}: {} missing; the recording has {}",
        path.display(), missing(wanted), recorded.join(", ")
    )]
    NoInput { path: PathBuf, stage: &'static str, wanted: Vec<String>, recorded: Vec<String> },
    #[error(
        "{}: topic {topic} has version {} and layout {:016x}, {stage} reads version {} and layout {:016x}",
        path.display(), recorded.0, recorded.1, expected.0, expected.1
    )]
    Layout { path: PathBuf, topic: String, stage: &'static str, recorded: (u32, u64), expected: (u32, u64) },
}

fn missing(topics: &[String]) -> String {
    let (word, verb) = if topics.len() == 1 { ("topic", "is") } else { ("topics", "are") };
    format!("{word} {} {verb}", topics.join(", "))
}

/// The stage with its settings, its context, and the drive time between barriers; or all problems.
pub(super) fn configure(
    program: &dyn Program,
    arguments: &AloneArguments,
) -> Result<(Box<dyn ConfiguredStage>, Context, f64), Vec<ConfigurationError>> {
    let name = program.name();
    let absolute = |path: &Path| {
        std::path::absolute(path).map_err(|cause| vec![ConfigurationError::Path { path: path.to_owned(), cause }])
    };
    let launch = arguments.launch.as_deref().map(absolute).transpose()?;
    let changes = [&arguments.unset[..], &arguments.set].concat();
    let file = match &launch {
        Some(path) => LaunchFile::load(path, &changes),
        None => LaunchFile::parse(Path::new("command line"), String::new(), &changes),
    };
    let file = file.map_err(|problems| {
        let texts = problems.iter().map(|problem| format!("{} {}", problem.key, problem.text));
        texts.map(ConfigurationError::Launch).collect::<Vec<_>>()
    })?;
    let shown = |problem: &Problem| ConfigurationError::Launch(file.render(problem));
    let rendered = |problem| vec![shown(&problem)];
    let (stage, problems) = program.configured(&own_table(&file, name).map_err(rendered)?);
    let mut faults: Vec<_> = problems.into_iter().map(|problem| shown(&file.located(name, problem))).collect();

    let folder =
        launch.as_deref().and_then(Path::parent).map_or_else(|| absolute(Path::new(".")), |f| Ok(f.to_owned()))?;
    let run = file.table("run").map_err(rendered)?;
    let of_run = |key: &str| run.iter().find(|(name, _)| name.get_ref() == key).map(|(_, value)| value.get_ref());
    let place = |given: &Option<PathBuf>, key: &str| match (given, of_run(key).and_then(DeValue::as_str)) {
        (Some(path), _) => absolute(path).map(Some),
        (None, Some(text)) => Ok(Some(folder.join(text))),
        (None, None) => Ok(None),
    };
    let drive = place(&arguments.drive, "drive")?;
    let output = place(&arguments.output, "output")?;
    if drive.is_none() && program.inputs().is_empty() {
        faults.push(ConfigurationError::NoDrive);
    }
    if output.is_none() && program.outputs().is_empty() {
        faults.push(ConfigurationError::NoOutput);
    }
    let barrier_s = match of_run("barrier_s") {
        Some(DeValue::Float(number)) => number.as_str().parse().ok(),
        Some(DeValue::Integer(number)) => number.as_str().parse().ok(),
        _ => None,
    }
    .filter(|seconds| *seconds > 0.0);
    let inputs = stage.inputs(&folder).map_err(|error| ConfigurationError::Launch(error.to_string()));
    let recorded = match &arguments.recording {
        Some(path) => inputs.and_then(|inputs| recorded_topics(name, &inputs, path)).unwrap_or_else(|error| {
            faults.push(error);
            Vec::new()
        }),
        None => Vec::new(),
    };
    let own = program.outputs().iter().map(|port| port.topic().to_owned()).collect::<Vec<_>>();
    let context = Context {
        drive: drive.unwrap_or_default(),
        output: output.unwrap_or_else(|| folder.clone()),
        launch_folder: folder,
        mode: Mode::Offline,
        connected: recorded.into_iter().chain(own).collect(),
        missing: Vec::new(),
    };
    // A setting that is invalid by itself would only cause further errors.
    if faults.is_empty() {
        let problems = stage.check(&context);
        faults.extend(problems.into_iter().map(|problem| shown(&file.located(name, problem))));
    }
    if faults.is_empty() { Ok((stage, context, barrier_s.unwrap_or(BARRIER_S))) } else { Err(faults) }
}

/// Topics of the recording. Fails if a topic that the stage needs is missing, if all its topics are missing, or if the
/// layout of a topic differs.
fn recorded_topics(stage: &'static str, inputs: &[Port], path: &Path) -> Result<Vec<String>, ConfigurationError> {
    let reader = RecordingReader::open(path)?;
    let recorded: Vec<String> =
        reader.topics().iter().filter_map(|topic| topic.ticks_of()).map(str::to_owned).collect();
    for port in inputs.iter().map(Port::describe) {
        let path = path.to_owned();
        let topic = port.topic;
        let Some(found) = reader.topics().iter().find(|found| found.name == topic) else {
            if port.optional {
                tracing::info!(topic, recording = %path.display(), "the optional topic is not recorded and stays empty");
                continue;
            }
            return Err(ConfigurationError::NoTopic { path, topic, stage });
        };
        let recorded = (found.table.version, found.table.layout);
        let expected = (port.version, port.layout);
        if recorded != expected {
            return Err(ConfigurationError::Layout { path, topic, stage, recorded, expected });
        }
    }
    let wanted: Vec<String> = inputs.iter().map(|port| port.topic().to_owned()).collect();
    if wanted.iter().any(|topic| recorded.contains(topic)) {
        return Ok(recorded);
    }
    Err(ConfigurationError::NoInput { path: path.to_owned(), stage, wanted, recorded })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Flow, Inputs, Outputs, Stage, StateBytes, StepError};
    use messages::{ByteTable, ClassTopic, GnssTopic, ImuTopic};
    use recording::RecordingWriter;
    use std::collections::BTreeMap;

    crate::settings! {
        /// No settings.
        pub struct NoSettings {}
    }

    /// A stage without required inputs.
    struct Optional;

    impl Stage for Optional {
        const NAME: &'static str = "optional";
        type Settings = NoSettings;
        fn inputs() -> Vec<Port> {
            vec![Port::optional::<GnssTopic>(), Port::optional::<ImuTopic>()]
        }
        fn outputs() -> Vec<Port> {
            Vec::new()
        }
        fn new(_settings: &NoSettings, _context: &Context) -> Result<Self, StepError> {
            Ok(Self)
        }
        fn step(&mut self, _inputs: &mut Inputs, _outputs: &mut Outputs) -> Result<Flow, StepError> {
            Ok(Flow::Continue)
        }
        fn save(&mut self) -> Result<StateBytes<'_>, StepError> {
            Ok(Vec::new().into())
        }
    }

    /// The topics of a stage that a recording of one topic contains.
    fn topics_from_recording(folder: &Path, table: ByteTable) -> Result<Vec<String>, ConfigurationError> {
        let path = folder.join("in.mcap");
        let topic = table.topic.clone();
        let mut writer = RecordingWriter::create(&path, &BTreeMap::new(), &[table]).expect("creates");
        writer.tick(&topic, &messages::TickRow { end: 1, ..Default::default() }).expect("writes");
        writer.finish().expect("finishes");
        recorded_topics(Optional::NAME, &Optional::inputs(), &path)
    }

    #[test]
    fn recording_without_any_input_of_the_stage_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let found = topics_from_recording(folder.path(), ByteTable::of::<ImuTopic>()).expect("has an input");
        assert_eq!(found, ["imu"]);
        let error =
            topics_from_recording(folder.path(), ByteTable::of::<ClassTopic>()).expect_err("refused").to_string();
        assert!(
            error.ends_with("in.mcap: has no input of optional: topics gnss, imu are missing; the recording has class"),
            "{error}"
        );
    }
}
