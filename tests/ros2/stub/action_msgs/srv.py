class CancelGoal:
    class Request:
        pass
