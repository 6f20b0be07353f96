# A waiter is an object.
class Waiter:
    def __init__(self, lobby, kitchen):
        self.lobby, self.kitchen, self.order = lobby, kitchen, None

    def take_order(self):
        go_to(self.lobby)
        self.order = ask("visitor", "What would you like to drink?", ["Iced tea", "Lemonade", "Water"])

    def serve(self):
        go_to(self.kitchen)
        thing = self.order.lower()
        pick(thing)
        go_to(self.lobby)
        say("One " + thing + " for you.")
        place(thing)


def task_program():
    waiter = Waiter("lobby", "kitchen")
    waiter.take_order()
    waiter.serve()
