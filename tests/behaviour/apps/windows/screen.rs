//! A virtual X server, the program on it, and what is seen of it.

use std::{
    fs::{self, File},
    io::{BufRead, BufReader},
    path::PathBuf,
    process::{Child, Command, ExitStatus, Stdio},
    sync::atomic::{AtomicU32, Ordering},
    thread::sleep,
    time::{Duration, Instant},
};

use crate::support::program;

pub const PATIENCE: Duration = Duration::from_secs(300);
pub const SCREEN: [usize; 2] = [960, 540];

pub fn binary(name: &str) -> PathBuf {
    let path = program::binary().with_file_name(format!("{name}{}", std::env::consts::EXE_SUFFIX));
    assert!(path.is_file(), "{} is missing: cargo build --features inspector --examples makes it", path.display());
    path
}

/// Looks until there is something.
pub fn wait<T>(what: &str, patience: Duration, mut look: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(start.elapsed() < patience, "after {} s still waiting for {what}", patience.as_secs());
        sleep(Duration::from_millis(100));
    }
}

/// An X server without a screen, the one program that it shows, and a window manager where one is asked for. All end
/// with it.
pub struct Screen {
    server: Child,
    manager: Option<Child>,
    program: Child,
    display: String,
    pub folder: PathBuf,
    pub window: String,
}

impl Drop for Screen {
    fn drop(&mut self) {
        // One that has ended already is no matter, nor is what stays in the temporary folder.
        let failed = std::thread::panicking();
        if failed {
            let _ = fs::copy(self.folder.join("Xvfb_screen0"), self.folder.join("last.xwd"));
            eprintln!("what it showed last and what it said: last.xwd and program.log in {}", self.folder.display());
        }
        for process in self.manager.iter_mut().chain([&mut self.program, &mut self.server]) {
            let _ = process.kill();
            let _ = process.wait();
        }
        if !failed {
            let _ = fs::remove_dir_all(&self.folder);
        }
    }
}

/// A free display: its server, number, and the folder that its picture lies in.
fn serve(name: &str) -> (Child, String, PathBuf) {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    let folder = std::env::temp_dir().join(format!("cumulus-{name}-{}-{count}", std::process::id()));
    fs::create_dir_all(&folder).expect("the temporary folder can be written");
    let [width, height] = SCREEN;
    // Without -noreset it would start afresh, and refuse the program, when the first xdotool has gone.
    let mut server = Command::new("Xvfb")
        .args([
            "-displayfd",
            "1",
            "-noreset",
            "-nolisten",
            "tcp",
            "-nocursor",
            "-screen",
            "0",
            &format!("{width}x{height}x24"),
        ])
        .arg("-fbdir")
        .arg(&folder)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(File::create(folder.join("server.log")).expect("the folder can be written"))
        .spawn()
        .unwrap_or_else(|error| panic!("Xvfb does not start ({error}): install the package xvfb; scripts/test does"));
    let mut number = String::new();
    let said = BufReader::new(server.stdout.take().expect("it is piped")).read_line(&mut number);
    let log = fs::read_to_string(folder.join("server.log")).unwrap_or_default();
    if !said.is_ok_and(|length| length > 1) {
        let _ = server.kill();
        let _ = server.wait();
        panic!("Xvfb opened no display: {log}");
    }
    (server, format!(":{}", number.trim()), folder)
}

/// A window manager on this display.
fn manage(display: &str) -> Child {
    let started = Command::new("blackbox").env("DISPLAY", display).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
    let manager =
        started.unwrap_or_else(|error| panic!("blackbox does not start ({error}): install it; scripts/test does"));
    // It says in the root window that it is there.
    wait("the window manager", PATIENCE, || {
        let asked = Command::new("wmctrl").arg("-m").env("DISPLAY", display).output();
        let asked =
            asked.unwrap_or_else(|error| panic!("wmctrl does not start ({error}): install it; scripts/test does"));
        asked.status.success().then_some(())
    });
    manager
}

impl Screen {
    /// Starts the program, and waits for its window to have the keyboard.
    pub fn show(name: &str, title: &str, arguments: &[&str]) -> Self {
        Self::begin(name, title, arguments, false)
    }

    /// As [`show`](Self::show), on a desktop with a window manager.
    pub fn show_managed(name: &str, title: &str, arguments: &[&str]) -> Self {
        Self::begin(name, title, arguments, true)
    }

    fn begin(name: &str, title: &str, arguments: &[&str], managed: bool) -> Self {
        let (mut server, display, folder) = serve(name);
        let manager = managed.then(|| manage(&display));
        let log = File::create(folder.join("program.log")).expect("the folder can be written");
        let program = Command::new(binary(name))
            .args(arguments)
            .current_dir(&folder)
            .env("DISPLAY", &display)
            .env("RUST_LOG", "warn")
            .env("NO_COLOR", "1")
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("WAYLAND_SOCKET")
            .stdin(Stdio::null())
            .stdout(log.try_clone().expect("a file can be shared"))
            .stderr(log)
            .spawn();
        let program = program.unwrap_or_else(|error| {
            let _ = server.kill();
            panic!("{name} does not start: {error}")
        });
        let mut screen = Self { server, manager, program, display, folder, window: String::new() };
        screen.window = wait("a window", PATIENCE, || {
            screen.check();
            let found = screen.tool(&["search", "--onlyvisible", "--name", title])?;
            // Only the keyboard's owner hears keys, and no window manager gives it away.
            screen.tool(&["windowfocus", &found])?;
            (screen.tool(&["getwindowfocus"])? == found).then_some(found)
        });
        screen
    }

    /// What xdotool printed, if it succeeded.
    fn tool(&self, arguments: &[&str]) -> Option<String> {
        let output = Command::new("xdotool").args(arguments).env("DISPLAY", &self.display).output();
        let output =
            output.unwrap_or_else(|error| panic!("xdotool does not start ({error}): install it; scripts/test does"));
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    }

    pub fn act(&self, arguments: &[&str]) {
        assert!(self.tool(arguments).is_some(), "xdotool {arguments:?} failed");
    }

    /// Asks the window manager, as its own buttons do.
    pub fn ask(&self, arguments: &[&str]) {
        let asked = Command::new("wmctrl").args(arguments).env("DISPLAY", &self.display).status();
        assert!(asked.is_ok_and(|status| status.success()), "wmctrl {arguments:?} failed");
    }

    /// How the program ended, once it has.
    pub fn end(&mut self) -> ExitStatus {
        let status = wait("the program to end", PATIENCE, || self.program.try_wait().expect("a child can be asked"));
        self.check_log();
        status
    }

    fn check_log(&self) -> String {
        let log = fs::read_to_string(self.folder.join("program.log")).expect("the program has a log");
        let bad = ["panicked", "ERROR", "Validation", "error:"].into_iter().find(|word| log.contains(word));
        assert!(bad.is_none(), "the program said {bad:?}: {log}");
        log
    }

    /// The program runs, and has said nothing that a user should not see.
    pub fn check(&mut self) {
        let log = self.check_log();
        let ended = self.program.try_wait().expect("a child can be asked");
        assert!(ended.is_none(), "the program ended with {ended:?}: {log}");
    }

    pub fn wait_for(&mut self, what: &str, mut come: impl FnMut(&Picture) -> bool) -> Picture {
        wait(what, PATIENCE, || {
            self.check();
            Some(self.picture()).filter(&mut come)
        })
    }

    /// Holds keys down until what they do is seen.
    pub fn hold_until(&mut self, keys: &[&str], what: &str, come: impl FnMut(&Picture) -> bool) -> Picture {
        keys.iter().for_each(|key| self.act(&["keydown", key]));
        let picture = self.wait_for(what, come);
        keys.iter().rev().for_each(|key| self.act(&["keyup", key]));
        picture
    }

    /// Presses a key and waits for this part of the picture to become another.
    pub fn press(&mut self, key: &str, part: Part) -> Picture {
        let before = self.picture();
        self.act(&["key", key]);
        self.wait_for(&format!("{key} to change {part:?}"), |now| now.differs(&before, part) > 0.0)
    }

    pub fn click(&self, [x, y]: [usize; 2]) {
        self.act(&[
            "mousemove",
            &x.to_string(),
            &y.to_string(),
            "sleep",
            "0.4",
            "mousedown",
            "1",
            "sleep",
            "0.3",
            "mouseup",
            "1",
        ]);
    }

    /// What is on the screen: the server's own memory, in the X window dump format.
    pub fn picture(&self) -> Picture {
        let dump = fs::read(self.folder.join("Xvfb_screen0")).expect("Xvfb keeps its picture there");
        // 32-bit numbers, big end first: 0 length of the header, 4 and 5 size, 11 bits a pixel, 12 bytes a line,
        // 19 number of colours, of 12 bytes each, before the picture.
        let word = |i: usize| u32::from_be_bytes(dump[4 * i..4 * i + 4].try_into().expect("four bytes")) as usize;
        assert_eq!([word(4), word(5), word(11), word(12)], [SCREEN[0], SCREEN[1], 32, 4 * SCREEN[0]]);
        Picture(dump[word(0) + 12 * word(19)..].to_vec())
    }
}

/// Left, top, right, bottom, in pixels.
pub type Part = [usize; 4];

/// Blue, green, red and nothing, a byte each.
#[derive(Clone)]
pub struct Picture(Vec<u8>);

impl Picture {
    fn pixels(&self, [left, top, right, bottom]: Part) -> impl Iterator<Item = [u8; 3]> {
        (top..bottom).flat_map(move |y| {
            (left..right).map(move |x| {
                let at = 4 * (y * SCREEN[0] + x);
                [self.0[at + 2], self.0[at + 1], self.0[at]]
            })
        })
    }

    fn mean(&self, part: Part, of: impl Fn([u8; 3]) -> f64) -> f64 {
        self.pixels(part).map(of).sum::<f64>() / self.pixels(part).count() as f64
    }

    /// 0 to 255.
    pub fn brightness(&self, part: Part) -> f64 {
        self.mean(part, |pixel| pixel.map(f64::from).iter().sum::<f64>() / 3.0)
    }

    /// The share that is grey: cloud, and not blue sky.
    pub fn grey(&self, part: Part) -> f64 {
        self.mean(part, |[r, _, b]| f64::from(r > 20 && f64::from(r) > 0.85 * f64::from(b)))
    }

    /// Mean difference of a channel, 0 to 255.
    pub fn differs(&self, other: &Self, part: Part) -> f64 {
        let pairs = self.pixels(part).zip(other.pixels(part));
        let sum: u32 = pairs.flat_map(|(a, b)| [0, 1, 2].map(|i| u32::from(a[i].abs_diff(b[i])))).sum();
        f64::from(sum) / (3 * self.pixels(part).count()) as f64
    }
}
