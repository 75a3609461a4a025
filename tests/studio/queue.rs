//! Scenes that are fitted one after the other.

use super::support::{TestStudio, small_scene};
use patina::studio::act::Act;
use patina::studio::model::queue::QueueState;
use patina::studio::model::{FitStatus, Model};
use patina::studio::workspace::Panel;
use std::path::{Path, PathBuf};

/// A copy of the small scene.
fn copied(folder: &Path, name: &str) -> PathBuf {
    fn copy(from: &Path, to: &Path) {
        std::fs::create_dir_all(to).unwrap();
        for entry in std::fs::read_dir(from).unwrap() {
            let (path, to) = (entry.as_ref().unwrap().path(), to.join(entry.unwrap().file_name()));
            match path.is_dir() {
                true => copy(&path, &to),
                false => drop(std::fs::copy(&path, &to).unwrap()),
            }
        }
    }
    let to = folder.join(name);
    copy(small_scene(), &to);
    to
}

fn states(model: &Model) -> Vec<QueueState> {
    model.queue.scenes().iter().map(|scene| scene.state.clone()).collect()
}

#[test]
fn folders_dropped_together_are_fitted_in_turn_and_one_that_cannot_be_opened_is_passed_over() {
    let mut studio = TestStudio::new();
    let folder = studio.folder.path().to_path_buf();
    let [broken, sound] = ["broken", "sound"].map(|name| copied(&folder, name));
    std::fs::write(broken.join("scene.json"), "{").unwrap();
    studio.model().all_dropped(vec![broken, sound.clone()]);
    // A scene that is read is not ready yet: what is asked of its fit can still be changed.
    let own = sound.clone();
    studio.wait("the sound scene", move |model| {
        model.project.as_ref().is_some_and(|project| project.path == Some(own.clone()))
    });
    studio.ask_for_little();
    studio.wait("the end of the queue", |model| matches!(states(model).last(), Some(QueueState::Done(_))));
    let told = states(studio.model());
    assert!(matches!(&told[0], QueueState::NotDone(why) if why.contains("could not be opened")), "{told:?}");
    let QueueState::Done(run) = &told[1] else { panic!("{told:?}") };
    assert!(run.join("report.html").is_file() && *run == studio.run_folder());
    assert_eq!(studio.model().project.as_ref().unwrap().path.as_deref(), Some(sound.as_path()));
    studio.show(Panel::Fit);
    assert!(studio.says("not fitted: it could not be opened") && studio.says("finished"));
    studio.click("Clear finished");
    studio.frames(2);
    assert!(studio.model().queue.scenes().is_empty() && studio.model().queue.waiting() == 0);
}

#[test]
fn who_stops_a_fit_of_the_queue_holds_it_and_it_goes_on_when_asked() {
    let mut studio = TestStudio::new();
    let folder = studio.folder.path().to_path_buf();
    let [first, second, third] = ["first", "second", "third"].map(|name| copied(&folder, name));
    studio.model().queue_scenes(vec![first.clone(), second, first.clone(), third.clone()]);
    assert!(studio.log().contains("in the queue already"), "{}", studio.log());
    studio.wait("the first fit", |model| model.fit.status == FitStatus::Running);
    studio.act(Act::Stop);
    studio.wait("the end of the first", |model| model.queue.is_held);
    assert_eq!(states(studio.model())[1..], [QueueState::Waiting, QueueState::Waiting]);
    assert_eq!(states(studio.model())[0], QueueState::NotDone("stopped".into()));
    studio.frames(10);
    assert_eq!(studio.model().project.as_ref().unwrap().path.as_deref(), Some(first.as_path()), "nothing moves on");
    studio.show(Panel::Fit);
    studio.controls("Remove")[1].click();
    studio.frames(2);
    assert_eq!(studio.model().queue.waiting(), 1);
    studio.click("Resume queue");
    studio.wait("the second scene", |model| states(model)[1] == QueueState::AtWork && model.project.is_some());
    // What else is opened is not taken away again.
    studio.model().open(third.clone());
    studio.wait("the third scene", |model| {
        model.project.as_ref().is_some_and(|project| project.path.as_deref() == Some(third.as_path()))
    });
    studio.wait("the end of the second", |model| matches!(states(model)[1], QueueState::NotDone(_)));
}
