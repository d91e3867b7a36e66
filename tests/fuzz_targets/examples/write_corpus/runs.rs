//! Files written by the processes of a run, and models on range images.

use drive::SourcePosition;
use messages::{
    ByteTable, ClassRow, ClassTopic, Envelope, GnssTopic, ImageTopic, Message, MosaicTopic, Pod, TickTopic,
    TrajectoryTopic,
};
use run::Outcome;
use run::assignment::{Assignment, Description, PortDescription, TopicChannels};
use run::health::{Activity, Health, ReportedDoubt, Traffic};
use run::summary::{StageSummary, Summary};
use run::wiring::{WiredStage, WiredTopic, Wiring};
use segmentation::network::{NetworkSpec, TensorShape, WeightTensor, Weights};
use segmentation::spherical::{Features, GroundUse, N_FEATURES, Settings};
use stage::{Received, StateBytes};
use std::collections::BTreeMap;

fn json(value: &impl serde::Serialize) -> Vec<u8> {
    serde_json::to_vec(value).expect("encodes")
}

fn health() -> Health {
    let traffic = || BTreeMap::from([("class".to_owned(), Traffic { messages: 3, ..Traffic::default() })]);
    Health {
        activity: Activity::Waiting("class".to_owned()),
        drive_begin: Some(-5),
        inputs: traffic(),
        outputs: traffic(),
        counters: BTreeMap::from([("lost".to_owned(), 2)]),
        doubts: vec![ReportedDoubt { name: "drift".to_owned(), size: 1.5, text: "a text".to_owned() }],
        ..Health::default()
    }
}

fn port() -> PortDescription {
    PortDescription {
        topic: ClassTopic::TOPIC.to_owned(),
        version: ClassTopic::VERSION,
        layout: ClassTopic::LAYOUT,
        queue: ClassTopic::QUEUE,
        borrowed: ClassTopic::BORROWED,
        optional: false,
        table: ByteTable::of::<ClassTopic>(),
    }
}

fn channels() -> TopicChannels {
    let text = r#"{"name":"class","version":1,"layout":5,"header_bytes":8,"row_bytes":2,"max_rows":100,"drops_oldest":false,"queue":4,
        "borrowed":2,"producer":"infer.wake","consumers":["export.wake"]}"#;
    let channel = || serde_json::from_str(text).expect("is a channel");
    TopicChannels { topic: "class".to_owned(), port: "class".to_owned(), messages: channel(), ticks: channel() }
}

pub fn run_texts() -> Vec<Vec<u8>> {
    let assignment = r#"{"stage":"infer","domain":"d","supervisor":7,"context":{"drive":"/d","output":"/o","launch_folder":"/l",
        "mode":"offline","connected":["class"],"missing":[]},"launch_file":"/l/launch.toml","changes":[{"set":{"table":"infer","key":"model","value":"m"}}],"inputs":[],"outputs":[],
        "barrier_s":5.0,"states":"/o/states","resume":3,"restart":{"epoch":1,"ticks":2,"inputs":{},"outputs":{}}}"#;
    let assignment = serde_json::from_str::<Assignment>(assignment).expect("is an assignment");
    let assignment = Assignment { inputs: vec![channels()], ..assignment };
    let description = Description {
        contract: 4,
        name: "infer".to_owned(),
        inputs: vec![port()],
        outputs: vec![],
        settings: vec![],
        files: [].into(),
    };
    let command = run::assignment::Command { go: true, ..Default::default() };
    vec![json(&health()), json(&assignment), json(&description), json(&command)]
}

pub fn summary() -> Vec<u8> {
    let stage = StageSummary::new("infer", "/bin/infer".as_ref(), health(), 1.0, 0, 2.0);
    json(&Summary { outcome: Outcome::Done, stages: vec![stage], ..Summary::default() })
}

pub fn wiring() -> Vec<u8> {
    let stage = WiredStage {
        name: "infer".to_owned(),
        program: "/bin/infer".into(),
        inputs: vec!["submap".to_owned()],
        outputs: vec![WiredTopic::new(&channels(), &port())],
    };
    json(&Wiring { domain: "d".to_owned(), supervisor: 7, attempt: 1, mode: run::Mode::Offline, stages: vec![stage] })
}

fn message<T: Message>(rows: Vec<T::Row>) -> Received<T> {
    let envelope = Envelope { seq: 3, stamp: 5, len: rows.len() as u32, ..Envelope::default() };
    Received::in_own_memory(envelope, T::Header::default(), rows)
}

fn zeros<R: Pod>(n: usize) -> Vec<R> {
    messages::pod::rows_from_bytes(&vec![0; n * size_of::<R>()]).expect("whole rows")
}

pub fn state_head() -> Vec<u8> {
    let fixes = message::<GnssTopic>(zeros(2));
    let poses = message::<TrajectoryTopic>(zeros(1));
    let mut state = StateBytes::with_head(2, &SourcePosition::Clouds { next: 4, taken: 0, n_bad: 1 }).expect("encodes");
    state.push(&fixes);
    state.push(&poses);
    state.to_vec()
}

pub fn saved_messages() -> Vec<Vec<u8>> {
    let of = |topic: u8, bytes: Vec<u8>| [vec![topic], bytes].concat();
    vec![
        of(1, message::<TickTopic>(zeros(1)).to_bytes()),
        of(2, message::<TrajectoryTopic>(zeros(2)).to_bytes()),
        of(7, message::<ClassTopic>(vec![ClassRow { class_id: 7, score: 1 }; 5]).to_bytes()),
        of(10, message::<GnssTopic>(zeros(1)).to_bytes()),
        of(12, message::<ImageTopic>(zeros(6)).to_bytes()),
        of(13, message::<MosaicTopic>(zeros(6)).to_bytes()),
    ]
}

/// The headers of two models; the target adds the tensors.
pub fn spherical_models() -> Vec<Vec<u8>> {
    let unet = NetworkSpec::Unet { inputs: N_FEATURES, outputs: 3, widths: vec![2, 2], head: Some(1) };
    let dz = NetworkSpec::SphericalDz { inputs: N_FEATURES, outputs: 3, widths: vec![2] };
    let header = |network: NetworkSpec| {
        let tensors = network.layers().into_iter().flat_map(|layer| layer.tensors());
        let zeros = |TensorShape { name, shape }: TensorShape| {
            let values = vec![0.0; shape.iter().product()];
            (name, WeightTensor { shape, values })
        };
        let weights = Weights { tensors: tensors.map(zeros).collect() };
        let classes = ["road", "building", "vehicles"].map(str::to_owned).to_vec();
        let settings = Settings {
            network,
            columns: 512,
            fold: 1,
            classes,
            vote_cell_m: 0.2,
            temperature: 1.0,
            ground_intensities: None,
            nearest: None,
            notice: None,
            features: Features::default(),
            ground: GroundUse::Kept,
        };
        let file = settings.to_bytes(&weights).expect("encodes");
        let (length, rest) = file.split_first_chunk().expect("has a length");
        rest[..u64::from_le_bytes(*length) as usize].to_vec()
    };
    vec![header(unet), header(dz)]
}
