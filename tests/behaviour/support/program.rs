//! The headless example as a user runs it, and folders for its files.

use std::{
    fs,
    ops::Deref,
    path::{Path, PathBuf},
    process::Command,
    sync::atomic::{AtomicU32, Ordering},
};

use image::{DynamicImage, ImageReader, Rgba32FImage};

pub fn binary() -> PathBuf {
    let tests = std::env::current_exe().expect("a test knows its own path");
    let folder = tests.parent().and_then(Path::parent).expect("tests lie in target/PROFILE/deps");
    let path = folder.join("examples").join(format!("headless{}", std::env::consts::EXE_SUFFIX));
    assert!(path.is_file(), "{} is missing: cargo build --example headless makes it", path.display());
    path
}

/// A new, empty folder for a test's files; gone when the test is.
pub struct Folder(PathBuf);

impl Folder {
    pub fn new() -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let name = format!("cumulus-headless-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        let path = std::env::temp_dir().join(name);
        fs::create_dir_all(&path).expect("the temporary folder can be written");
        Self(path)
    }

    /// In one step: a load still on its way must not find the file half written.
    pub fn write(&self, file: &str, bytes: impl AsRef<[u8]>) {
        let next = self.join("next");
        fs::write(&next, bytes).and_then(|()| fs::rename(&next, self.join(file))).expect("the folder can be written");
    }
}

impl Deref for Folder {
    type Target = Path;
    fn deref(&self) -> &Path {
        &self.0
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // What is left lies where the system clears up.
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// The example as it is started by hand: cargo and the scripts tell Bevy where the repository's assets are, a shell does
/// not.
pub fn command() -> Command {
    let mut command = Command::new(binary());
    command.env_remove("CARGO_MANIFEST_DIR").env_remove("BEVY_ASSET_ROOT");
    command
}

pub fn read(path: &Path) -> DynamicImage {
    let reader = ImageReader::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    reader.decode().unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

pub fn read_cloud(path: &Path) -> Rgba32FImage {
    match read(path) {
        DynamicImage::ImageRgba32F(image) => image,
        other => panic!("{}: RGBA in 32-bit float expected, found {:?}", path.display(), other.color()),
    }
}
