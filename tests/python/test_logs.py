"""Logs in the Python package: read, made from arrays and tables, resampled; the first task file.

    test_logs.py FOLDER OTED     FOLDER holds the package oted, "" where it is installed; OTED is the program
"""

import datetime
import hashlib
import subprocess
import unittest

from support import HOPPER, PENDULUM, InFolder, take_package, take_program

OTED = take_program(__doc__)
take_package(__doc__)

import h5py  # noqa: E402
import numpy as np  # noqa: E402

import oted  # noqa: E402
from oted.streams import Channel, to_logs  # noqa: E402


class LogsTest(InFolder):
    def test_hdf5_is_read_as_the_file_has_it(self):
        logs = oted.read_logs(HOPPER)
        with h5py.File(HOPPER) as file:
            np.testing.assert_array_equal(logs.observations, file["observations"][()])
            np.testing.assert_array_equal(logs.actions, file["actions"][()])
            n_ends = int((file["terminals"][()].astype(bool) | file["timeouts"][()].astype(bool)).sum())
        self.assertEqual(len(logs.episodes), n_ends)
        some = oted.read_logs(HOPPER, episodes=2)
        self.assertEqual(some.episodes, logs.episodes[:2])

    def test_what_is_saved_reads_back_the_same(self):
        logs = oted.read_logs(HOPPER)
        for name in ("a.hdf5", "b.npz", "c-v0"):
            logs.save(self.folder / name)
            back = oted.read_logs(self.folder / name)
            np.testing.assert_array_equal(back.observations, logs.observations)
            np.testing.assert_array_equal(back.next_observations, logs.next_observations)
            self.assertEqual(back.episodes, logs.episodes)

    def test_links_to_other_files_are_refused(self):
        with h5py.File(self.folder / "x.hdf5", "w") as file:
            file["observations"] = h5py.ExternalLink(HOPPER, "observations")
        with self.assertRaisesRegex(oted.DataError, "link to another file"):
            oted.read_logs(self.folder / "x.hdf5")

    def test_arrays_episodes_and_columns_give_the_same_logs(self):
        random = np.random.default_rng(0)
        episodes = [(random.normal(size=(n + 1, 2)), random.normal(size=(n, 1))) for n in (5, 3)]
        a = oted.Logs.from_episodes(episodes, period=0.1)
        rows = np.vstack([seen for seen, _ in episodes])
        done = np.vstack([np.vstack([act, [[9.0]]]) for _, act in episodes])
        b = oted.Logs(rows, done, episode_ends=[6, 10], period=0.1)
        columns = {"q": rows[:, 0], "v": rows[:, 1], "u": done[:, 0], "episode": np.array(["a"] * 6 + ["b"] * 4)}
        c = oted.Logs.from_pandas(columns, observations=["q", "v"], actions=["u"], episode="episode", period=0.1)
        for logs in (a, b, c):
            self.assertEqual(logs.episodes, [(0, 5, False), (5, 8, False)])
            np.testing.assert_array_equal(logs.observations, np.vstack([seen[:-1] for seen, _ in episodes]))
            np.testing.assert_array_equal(logs.next_observations, np.vstack([seen[1:] for seen, _ in episodes]))
            np.testing.assert_array_equal(logs.actions, np.vstack([act for _, act in episodes]))
            self.assertEqual(logs.period, 0.1)

    def test_times_are_brought_to_the_period_and_gaps_end_episodes(self):
        t = np.concatenate([np.arange(0, 1, 0.005), np.arange(3, 4, 0.005)])
        logs = oted.Logs(np.column_stack([2 * t]), np.column_stack([np.floor(t / 0.02 + 1e-9)]), times=t, period=0.02)
        self.assertEqual(len(logs.episodes), 2)
        self.assertTrue(any("gaps" in remark for remark in logs.remarks), logs.remarks)
        np.testing.assert_allclose(logs.next_observations - logs.observations, 0.04, atol=1e-9)
        np.testing.assert_allclose(logs.actions[:, 0], np.floor(logs.observations[:, 0] / 2 / 0.02 + 1e-6))
        with self.assertRaisesRegex(oted.UsageError, "rise"):
            oted.Logs(np.zeros((3, 1)), np.zeros((3, 1)), times=[0.0, 0.2, 0.1])

    def test_the_rows_of_tables_are_to_the_last_bit_those_of_the_first_version(self):
        (self.folder / "pendulum.xml").write_text(PENDULUM)
        task = oted.Task(model=self.folder / "pendulum.xml", control_period=0.02)
        digest = hashlib.sha256()
        for step, jitter, gap in ((20_000, 0, 0), (20_000, 7_000, 60_000), (5_000, 2_000, 15_000), (1_000, 0, 7_000),
                                  (8_000, 3_000, 900_000), (19_900, 900, 0)):  # [us]
            state, time, lines = 1, 0, ["time,joint/hinge/qpos,joint/hinge/qvel,actuator/motor,reward"]
            for i in range(300):
                state = state * 1103515245 % 2**31  # no generator of a library that may change
                shifted = time + (state >> 8) % (jitter + 1)
                lines.append(f"{shifted / 1e6},{i * i % 97 / 64},{i % 31 / 32},{shifted // 24_000 % 7 / 8},1")
                time += step + (gap if i % 90 == 50 else 0)
            (self.folder / "log.csv").write_text("\n".join(lines) + "\n")
            logs = oted.read_logs(self.folder / "log.csv", task=task)
            for array in (logs.observations, logs.actions, logs.next_observations, logs.rewards):
                digest.update(array.tobytes())
            digest.update(repr((logs.episodes, logs.period)).encode())
        self.assertEqual(digest.hexdigest()[:16], "e156f721123d113e")

    def test_wrapped_angles_go_on_from_every_source(self):
        t = 0.02 * np.arange(300)
        angle, wrapped = 7 * t + 0.1, np.remainder(7 * t + 0.1, 2 * np.pi)
        seen, done, names = np.column_stack([wrapped, t]), np.zeros((300, 1)), ["q", "v"]
        np.savetxt(self.folder / "log.csv", np.column_stack([t, seen, done]), delimiter=",", header="time,obs.q,obs.v,act.u",
                   comments="")
        for logs in (oted.Logs(seen, done, period=0.02, observation_names=names, unwrap=["q"]),
                     oted.Logs.from_pandas({"q": wrapped, "v": t, "u": done[:, 0]}, observations=names, actions=["u"],
                                           unwrap=["q"]),
                     oted.Logs.from_transitions(seen[:-1], done[:-1], seen[1:], observation_names=names, unwrap=["q"]),
                     oted.read_logs(self.folder / "log.csv", unwrap=["q"])):
            np.testing.assert_allclose(logs.observations[:, 0], angle[:len(logs)], atol=1e-12)
            np.testing.assert_allclose(logs.next_observations[:, 0], angle[1:len(logs) + 1], atol=1e-12)
            np.testing.assert_array_equal(logs.observations[:, 1], t[:len(logs)])
            self.assertIsNone(logs.path)
        with self.assertRaisesRegex(oted.UsageError, "no names"):
            oted.Logs(seen, done, unwrap=["q"])

    def test_logs_join_and_part(self):
        logs = oted.read_logs(HOPPER)
        again = logs.select([1, 0]) + logs.select([2])
        self.assertEqual(len(again.episodes), 3)
        begin, end, _ = logs.episodes[1]
        np.testing.assert_array_equal(again.observations[:end - begin], logs.observations[begin:end])
        self.assertIsNone(again.path)

    def test_joined_logs_go_by_the_names_of_their_channels(self):
        rows = np.arange(20.0)[:, None] + [0.0, 100.0]
        one = oted.Logs(rows, rows[:, :1], observation_names=["a", "b"], action_names=["u"], period=0.02)
        turned = oted.Logs(rows[:, ::-1], rows[:, :1], observation_names=["b", "a"], action_names=["u"], period=0.02)
        both = one + turned
        self.assertEqual((both.observation_names, both.period), (["a", "b"], 0.02))
        np.testing.assert_array_equal(both.observations[len(one):], one.observations)
        other = oted.Logs(rows, rows[:, :1], observation_names=["a", "c"], action_names=["u"])
        with self.assertRaisesRegex(oted.UsageError, "a, c, the first a, b"):
            one + other
        with self.assertRaisesRegex(oted.UsageError, "0.01 s apart"):
            one + oted.Logs(rows, rows[:, :1], period=0.01)

    def test_to_pandas_gives_what_from_pandas_reads(self):
        draw = np.random.default_rng(3)
        logs = oted.Logs(draw.normal(size=(9, 2)), draw.normal(size=(9, 1)), episode_ends=[4, 9], terminated=[True, False],
                         period=0.1, rewards=draw.normal(size=9), observation_names=["q", "v"], action_names=["u"])
        frame = logs.to_pandas()
        self.assertEqual(list(frame.columns), ["episode", "time", "q", "v", "u", "reward", "terminated"])
        self.assertEqual(len(frame), 9)
        again = oted.Logs.from_pandas(frame, observations=["q", "v"], actions=["u"], episode="episode", time="time", period=0.1,
                                      reward="reward", terminated="terminated")
        for name in ("observations", "actions", "next_observations", "rewards"):
            np.testing.assert_array_equal(getattr(again, name), getattr(logs, name), name)
        self.assertEqual((again.episodes, again.period), (logs.episodes, logs.period))
        nameless = oted.Logs(np.zeros((3, 2)), np.zeros((3, 1))).to_pandas()
        self.assertEqual(list(nameless.columns), ["episode", "observation_0", "observation_1", "action_0", "terminated"])

    def test_the_rows_of_an_episode_are_grouped_wherever_they_stand(self):
        t = np.concatenate([0.02 * np.arange(30), 0.02 * np.arange(12)])
        label = np.repeat([7, 3], [30, 12])
        order = np.argsort(t, kind="stable")
        frame = {"t": t[order], "e": label[order], "q": np.sin(t + label)[order], "u": t[order]}
        logs = oted.Logs.from_pandas(frame, observations=["q"], actions=["u"], episode="e", time="t", period=0.02)
        self.assertEqual([end - begin for begin, end, _ in logs.episodes], [29, 11])
        np.testing.assert_allclose(logs.observations[:29, 0], np.sin(t + label)[:29], atol=1e-12)
        with self.assertRaisesRegex(oted.UsageError, "label 7 comes again"):
            oted.Logs(frame["q"], frame["u"], episode=frame["e"])

    def test_another_period_than_the_tasks_is_refused(self):
        (self.folder / "pendulum.xml").write_text(PENDULUM)
        task = oted.Task(model=self.folder / "pendulum.xml", control_period=0.02)
        t = np.arange(0, 4, 0.01)
        logs = oted.Logs(np.column_stack([np.sin(t), np.cos(t)]), np.sin(3 * t)[:, None], period=0.01)
        with self.assertRaisesRegex(oted.UsageError, "lie 0.01 s apart, and the control period"):
            oted.check(logs, task)
        with self.assertRaisesRegex(oted.UsageError, "lie 0.01 s apart, and the control period"):
            oted.fit(task, logs, {"mass": oted.Param("body/*/mass", 0.5, 2)}, progress=False)

    def test_a_table_keeps_names_and_period_without_a_task(self):
        rows = np.arange(12.0)[:, None] + [0.0, 100.0]
        logs = oted.Logs(rows, rows[:, :1], observation_names=["joint/hip/qpos", "observer"], action_names=["actuator/hip"],
                         period=0.02)
        logs.save(self.folder / "log.csv")
        back = oted.read_logs(self.folder / "log.csv")
        self.assertEqual((back.observation_names, back.action_names), (logs.observation_names, logs.action_names))
        self.assertAlmostEqual(back.period, 0.02)
        np.testing.assert_array_equal(back.observations, logs.observations)

    def test_a_file_that_keeps_no_names_is_told(self):
        logs = oted.Logs(np.zeros((5, 1)), np.zeros((5, 1)), observation_names=["q"], action_names=["u"])
        with self.assertWarnsRegex(UserWarning, "keeps no names"):
            logs.save(self.folder / "log.npz")

    def test_constants_go_with_their_recordings_and_only_with_a_task_that_has_them(self):
        (self.folder / "pendulum.xml").write_text(PENDULUM)
        constants = {"load": {"field": "body/*/mass"}}
        task = oted.Task(model=self.folder / "pendulum.xml", control_period=0.02, constants=constants)
        t = np.arange(0, 4, 0.02)
        one = oted.Logs(np.column_stack([np.sin(t), np.cos(t)]), np.sin(3 * t)[:, None], period=0.02)
        both = one.with_constants(load=1.5) + one
        np.testing.assert_array_equal(both.constants["load"][:len(one)], 1.5)
        self.assertTrue(np.isnan(both.constants["load"][len(one):]).all())
        both.save(self.folder / "log.csv", task)
        back = oted.read_logs(self.folder / "log.csv", task)
        np.testing.assert_array_equal(back.constants["load"], both.constants["load"])
        self.assertEqual(oted.check(both, task).errors, [])
        with self.assertRaisesRegex(oted.UsageError, "constant 'lode'"):
            oted.check(one.with_constants(lode=1.0), task)

    def test_bad_arrays_are_usage_errors(self):
        for call in (lambda: oted.Logs(np.zeros((4, 2)), np.zeros((3, 1))),
                     lambda: oted.Logs(np.zeros((4, 2)), np.zeros((4, 1)), episode_ends=[2, 5]),
                     lambda: oted.Logs(np.zeros((4, 2)), np.zeros((4, 1)), episode_ends=["x"]),
                     lambda: oted.Logs(np.zeros((4, 2)), np.zeros((4, 1)), period=-1.0),
                     lambda: oted.Logs(np.zeros((4, 2)), np.zeros((4, 1)), period="x"),
                     lambda: oted.Logs(np.zeros((4, 2)), np.zeros((4, 1))) + oted.Logs(np.zeros((4, 3)), np.zeros((4, 1))),
                     lambda: oted.Logs([["x"]], [[0.0]]),
                     lambda: oted.Logs(np.zeros((4, 2)), np.zeros((4, 1)), episode_ends=[2.7, 4]),
                     lambda: oted.Logs(np.zeros((4, 2)), np.zeros((4, 1)), episode_ends=[float("inf"), 4]),
                     lambda: oted.Logs(np.zeros((4, 2)), np.zeros((4, 1)), period=True),
                     lambda: oted.Logs(np.zeros((4, 2)), np.zeros((4, 1))).with_constants(load=True),
                     lambda: oted.Logs(np.zeros((4, 2)), np.zeros((4, 1))).with_constants(load=10**400),
                     lambda: oted.Logs(np.zeros((4, 2)), np.zeros((4, 1))).select([True]),
                     lambda: oted.Logs(np.zeros((4, 2)), np.zeros((4, 1))).save(b"x.npz"),
                     lambda: oted.Logs(np.zeros((4, 2)), np.zeros((4, 1))).save("\udc80.npz"),
                     lambda: oted.Logs(np.zeros((4, 1)), np.zeros((4, 1)), observation_names=["\udc80"]),
                     lambda: oted.Logs([[10**400]] * 4, np.zeros((4, 1))),
                     lambda: to_logs([Channel(None, [0, 1], [0, 1])], [Channel("u", [0, 1], [0, 1])], 0.1),
                     lambda: to_logs(None, [Channel("u", [0, 1], [0, 1])], 0.1),
                     lambda: oted.Logs.from_pandas({"q": [], "u": []}, observations=["q"], actions=["u"], terminated="u"),
                     lambda: oted.Logs.from_pandas({"q": np.zeros(3)}, observations=["p"], actions=["q"])):
            with self.assertRaises(oted.UsageError) as raised:
                call()
            self.assertEqual(len(str(raised.exception).splitlines()), 1)
        with self.assertRaises(oted.DataError):
            oted.Logs(np.full((4, 2), np.nan), np.zeros((4, 1)))

    def test_what_a_mask_hides_is_no_number(self):
        rows, done = np.arange(20.0).reshape(10, 2), np.zeros((10, 1))
        whole, hidden = np.ma.array(rows, mask=False), np.ma.array(rows, mask=False)
        hidden[3, 1] = np.ma.masked
        np.testing.assert_array_equal(oted.Logs(whole, done).observations, rows[:-1])
        column = {"q": rows[:, 0], "u": done[:, 0]}
        for call in (lambda: oted.Logs(hidden, done), lambda: oted.Logs(list(hidden), done),
                     lambda: oted.Logs.from_episodes([(hidden, done)]),
                     lambda: oted.Logs.from_transitions(rows, done, hidden),
                     lambda: oted.Logs.from_transitions(rows, done, rows, terminals=hidden[:, 1] > 99),
                     lambda: oted.Logs.from_pandas({**column, "q": hidden[:, 1]}, observations=["q"], actions=["u"]),
                     lambda: oted.Logs(rows, done, episode=hidden[:, 1]),
                     lambda: to_logs([Channel("q", rows[:, 0], hidden[:, 1])], [Channel("u", rows[:, 0], done[:, 0])], 2.0)):
            with self.assertRaisesRegex(oted.UsageError, "row 3 is masked.*leave them out"):
                call()

    def test_rows_without_a_label_are_refused_and_not_dropped(self):
        rows = np.arange(6.0)
        for missing in (float("nan"), None, np.datetime64("NaT")):
            column = np.array([1, 1, missing, 2, 2, 2], dtype=object)
            with self.assertRaisesRegex(oted.UsageError, "column 'ep': row 2 has no label"):
                oted.Logs.from_pandas({"q": rows, "u": rows, "ep": column}, observations=["q"], actions=["u"], episode="ep")
            with self.assertRaisesRegex(oted.UsageError, "episode: row 2 has no label"):
                oted.Logs(rows, rows, episode=column)
        with self.assertRaisesRegex(oted.UsageError, "row 2 has no label"):
            oted.Logs(rows, rows, episode=[1.0, 1.0, np.nan, 2.0, 2.0, 2.0])
        with self.assertRaisesRegex(oted.DataError, "episode: row 0 has the label {}"):
            oted.Logs(rows, rows, episode=[{}] * 6)

    def test_a_flag_is_true_or_false_or_1_or_0(self):
        rows = np.arange(4.0)
        last = [(0, 4, True)]
        for kind in (bool, np.int8, np.float32, object):
            flags = np.array([0, 0, 0, 1], dtype=kind)
            self.assertEqual(oted.Logs.from_transitions(rows, rows, rows, terminals=flags).episodes, last)
            self.assertEqual(oted.Logs.from_transitions(rows, rows, rows, terminals=list(flags)).episodes, last)
        column = {"q": rows, "u": rows}
        for bad in ("False", float("nan"), 0.5, 2, None):
            flags = [0, 0, bad, 1]
            for call in (lambda: oted.Logs.from_transitions(rows, rows, rows, terminals=flags),
                         lambda: oted.Logs.from_transitions(rows, rows, rows, timeouts=np.array(flags, dtype=object)),
                         lambda: oted.Logs(rows, rows, episode_ends=[1, 2, 3, 4], terminated=flags),
                         lambda: oted.Logs.from_pandas({**column, "end": np.array(flags, dtype=object)}, observations=["q"],
                                                       actions=["u"], terminated="end")):
                with self.assertRaisesRegex(oted.UsageError, "got .* in (row|episode) 2, wanted True or False"):
                    call()

    def test_demonstrations_are_read_as_asked_or_not_at_all(self):
        file = self.folder / "demos.hdf5"
        with h5py.File(file, "w") as demos:
            demos["data/demo_0/obs/q"], demos["data/demo_0/actions"] = np.arange(4.0), np.zeros((4, 1))
        how = {"observations": ["q"], "period": 0.02}
        logs = oted.robomimic.read_robomimic(file, names={"q": "hip"}, scale={"hip": 2}, **how)
        np.testing.assert_array_equal(logs.observations[:, 0], [0, 2, 4])
        for given, said in (({"names": ["q"]}, "names: got"), ({"names": {"p": "hip"}}, "names: no channel 'p'; there are q, actions"),
                            ({"names": {"q": "hip"}, "scale": {"q": 2}}, "scale: no channel 'q'; there are hip, actions"),
                            ({"offset": {"q": "x"}}, "offset: 'q': got 'x'"), ({"actions": []}, "actions: got none"),
                            ({"episodes": 3}, "episodes: got 3"), ({"mask": 3}, "mask: got 3")):
            with self.subTest(said), self.assertRaisesRegex(oted.UsageError, said):
                oted.robomimic.read_robomimic(file, **{**how, **given})
        with self.assertRaisesRegex(oted.UsageError, "path: got 3"):
            oted.robomimic.read_robomimic(3, **how)

    def test_times_and_complex_numbers_are_no_observations(self):
        stamps = np.datetime64("2024-01-01", "ms") + 20 * np.arange(6)
        rows = np.arange(6.0)
        for bad in (stamps, stamps - stamps[0], stamps.astype(object), rows + 1j, (rows + 1j).astype(object)):
            with self.assertRaisesRegex(oted.UsageError, "column 'q': .*(times|complex)"):
                oted.Logs.from_pandas({"q": bad, "u": rows}, observations=["q"], actions=["u"])

    def test_time_stamps_may_have_a_zone_and_none_may_be_missing(self):
        zone = datetime.timezone(datetime.timedelta(hours=2))
        rows = np.arange(6.0)
        stamps = [datetime.datetime(2024, 1, 1, tzinfo=zone) + datetime.timedelta(milliseconds=20 * k) for k in range(6)]
        how = {"observations": ["q"], "actions": ["u"], "time": "t"}
        self.assertAlmostEqual(oted.Logs.from_pandas({"q": rows, "u": rows, "t": stamps}, **how).period, 0.02)
        utc = np.array([stamp.astimezone(datetime.UTC).replace(tzinfo=None) for stamp in stamps], dtype="M8[us]")
        utc[4] = np.datetime64("NaT")
        for t, said in ((utc, "row 4 has no time"), ([*stamps[:5], 3], "got 3 in row 5, wanted a time stamp"),
                        (["noon"] * 6, "wanted seconds or time stamps")):
            with self.assertRaisesRegex(oted.UsageError, f"column 't'.*{said}"):
                oted.Logs.from_pandas({"q": rows, "u": rows, "t": t}, **how)

    def test_logs_in_memory_are_called_so(self):
        with self.assertRaisesRegex(oted.DataError, "'in memory'"):
            oted.check(oted.Logs(np.zeros((4, 2)), np.zeros((4, 1))), "Hopper-v5")
        names = oted.describe("Hopper-v5")["observation_names"]
        some = oted.Logs(np.zeros((4, 2)), np.zeros((4, 3)), observation_names=names[:2])
        for call in (lambda: oted.check(some, "Hopper-v5"), lambda: some.save(self.folder / "log.csv", "Hopper-v5")):
            with self.assertRaisesRegex(oted.DataError, "'in memory': of the task's observations"):
                call()
        self.assertIsNone(some.path)


class Starting(InFolder):
    def test_a_first_task_file_is_the_programs(self):
        (self.folder / "pendulum.xml").write_text(PENDULUM)
        t = np.arange(200) * 0.01
        rows = np.stack([t, np.sin(3 * t), 3 * np.cos(3 * t), 0.1 * np.sin(5 * t)], axis=1)
        np.savetxt(self.folder / "log.csv", rows, delimiter=",", header="time,hinge_pos,hinge_vel,motor_cmd", comments="")
        names = [str(self.folder / name) for name in ("pendulum.xml", "log.csv", "python.toml", "program.toml")]
        proposal = oted.init(names[0], names[1], names[2])
        self.assertEqual(proposal.columns, {"hinge_pos": "joint/hinge/qpos", "hinge_vel": "joint/hinge/qvel",
                                            "motor_cmd": "actuator/motor"})
        subprocess.run([OTED, "init", *names[:2], "--out", names[3]], check=True, capture_output=True)
        text = (self.folder / "program.toml").read_text()
        self.assertEqual(repr(proposal), text.replace("program.toml", "python.toml"))
        self.assertEqual(oted.check(names[1], names[2]).errors, [])
        with self.assertRaisesRegex(oted.UsageError, "is there already"):
            oted.init(names[0], names[1], names[2])


class Streams(unittest.TestCase):
    """The rule of oted.streams, on signals whose values between the samples are known."""

    def test_states_are_interpolated_and_actions_held(self):
        q = np.arange(0, 1.0, 0.013)
        u = np.arange(-0.05, 1.0, 0.1)
        logs = to_logs([Channel("q", q, 3 * q)], [Channel("u", u, np.arange(len(u)))], 0.02)
        t = np.arange(len(logs)) * 0.02
        np.testing.assert_allclose(logs.observations[:, 0], 3 * t, atol=1e-12)
        np.testing.assert_array_equal(logs.actions[:, 0], np.floor((t + 0.05 + 1e-12) / 0.1))

    def test_a_gap_parts_episodes_and_nothing_lies_in_it(self):
        q = np.concatenate([np.arange(0, 0.5, 0.01), np.arange(0.7, 1.2, 0.01)])
        logs = to_logs([Channel("q", q, q)], [Channel("u", [0.0, 1.0], [0.0, 0.0])], 0.02)
        self.assertEqual(len(logs.episodes), 2)
        seen = np.concatenate([logs.observations, logs.next_observations])
        self.assertFalse(((seen > 0.4901) & (seen < 0.6999)).any())

    def test_times_since_1970_lose_nothing_that_matters(self):
        t = 1.7e9 + np.arange(0, 1, 0.01)
        logs = to_logs([Channel("q", t, t - 1.7e9)], [Channel("u", [1.7e9, 1.7e9 + 1], [0.0, 0.0])], 0.02)
        np.testing.assert_allclose(logs.observations[:, 0], np.arange(len(logs)) * 0.02, atol=1e-6)

    def test_clocks_that_do_not_meet_and_stamps_that_fall_are_errors(self):
        q = np.arange(0, 1, 0.01)
        with self.assertRaisesRegex(oted.DataError, "clocks"):
            to_logs([Channel("q", q, q)], [Channel("u", q + 50, q)], 0.02)
        with self.assertRaisesRegex(oted.DataError, "do not rise"):
            to_logs([Channel("q", np.repeat(q, 2), np.repeat(q, 2))], [Channel("u", q, q)], 0.02)


if __name__ == "__main__":
    unittest.main()
