//! A ROS 2 bag in a folder, perhaps split.

use crate::formats::topics::{EachRow, Offer, Source, Topic};
use crate::input::InputError;
use crate::rows::Ending;
use std::io;
use std::path::{Path, PathBuf};

const ENDINGS: [&str; 2] = [".mcap", ".db3"];
const COMPRESSED: &str = ".zstd";

/// Files of the bag in the order of their numbers (`run_0.mcap`, `run_1.mcap`); none without a bag, or with several.
/// Without `metadata.yaml`, which a killed recorder lacks.
///
/// # Errors
/// It is no folder that can be read.
pub fn files_of_bag(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut found: Vec<(String, Option<u64>, PathBuf)> = Vec::new();
    for entry in folder.read_dir()? {
        let file = entry?.path();
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let plain = name.strip_suffix(COMPRESSED).unwrap_or(&name);
        let Some(stem) = ENDINGS.iter().find_map(|ending| plain.strip_suffix(ending)) else { continue };
        let numbered = stem.rsplit_once('_').and_then(|(stem, number)| Some((stem, number.parse().ok()?)));
        let (stem, number) = numbered.map_or((stem, None), |(stem, number)| (stem, Some(number)));
        found.push((stem.to_owned(), number, file.clone()));
    }
    found.sort();
    let is_next = |pair: &[(String, Option<u64>, PathBuf)]| pair[0].0 == pair[1].0 && pair[0].1 < pair[1].1;
    let is_one_bag = found.windows(2).all(is_next);
    Ok(found.into_iter().filter(|_| is_one_bag).map(|(.., file)| file).collect())
}

pub(crate) struct SplitBag<'a> {
    files: Vec<Box<dyn Source + 'a>>,
    offer: Offer,
}

impl<'a> SplitBag<'a> {
    pub(crate) fn new(files: Vec<Box<dyn Source + 'a>>) -> Self {
        let mut topics: Vec<Topic> = Vec::new();
        for topic in files.iter().flat_map(|file| file.topics()) {
            match topics.iter_mut().find(|known| is_same(known, topic)) {
                Some(known) => known.rows = known.rows.zip(topic.rows).map(|(rows, more)| rows + more),
                None => topics.push(topic.clone()),
            }
        }
        Self { offer: Offer::new(files[0].offer().format, topics), files }
    }
}

/// True if one continues the other.
fn is_same(one: &Topic, other: &Topic) -> bool {
    one.name == other.name && one.kind == other.kind && one.columns == other.columns
}

impl Source for SplitBag<'_> {
    fn offer(&self) -> &Offer {
        &self.offer
    }

    fn read(&mut self, topic: usize, columns: &[usize], each: &mut EachRow) -> Result<Ending, InputError> {
        let mut all = Ending::default();
        for file in &mut self.files {
            let Some(at) = file.topics().iter().position(|of| is_same(of, &self.offer.topics[topic])) else { continue };
            let Ending { damage, notes } = file.read(at, columns, each)?;
            all.notes.extend(notes);
            if damage.is_some() {
                all.damage = damage;
                break;
            }
        }
        all.notes.sort();
        all.notes.dedup();
        Ok(all)
    }
}
