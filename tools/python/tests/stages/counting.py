"""A stage with a state: the score of a point is the number of submaps before its own."""

import threading
import time

import replica


class Counting(replica.Stage):
    name, inputs, outputs = "infer", ["submap"], ["class"]

    def setup(self):
        self.n_submaps = self.n_turns = 0
        threading.Thread(target=self.turn, daemon=True).start()

    def turn(self):
        while True:
            self.n_turns += 1
            time.sleep(0.001)

    def step(self, inputs, outputs):
        for submap in inputs["submap"]:
            out = outputs.loan("class", like=submap)
            out["class_id"][:] = submap["ring"] % 23
            out["score"][:] = self.n_submaps
            outputs.publish(out)
            self.n_submaps += 1
            outputs.count("submaps_counted")
        if self.n_turns > 20:
            outputs.note("another thread runs while the stage waits")

    def save(self):
        return self.n_submaps.to_bytes(8, "little")

    def restore(self, state):
        self.n_submaps = int.from_bytes(state, "little")


if __name__ == "__main__":
    replica.run(Counting)
